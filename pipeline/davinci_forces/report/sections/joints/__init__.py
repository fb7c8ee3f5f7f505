"""One page a joint: its equation, its parameters, and the residual of its fit."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.estimators import title_of
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import Diagnostic, Fit, Identifiability, Prediction, Residual
from davinci_forces.records.record import as_list, slug
from davinci_forces.report.content import Block, Bullets, Cell, Equation, OnScreen, Prose, Section, Table, Verdict
from davinci_forces.report.content.inline import literal, message
from davinci_forces.report.content.number import Number, in_format
from davinci_forces.report.context import Context, fit_name, name_in_sentence, title
from davinci_forces.report.results import format_unit
from davinci_forces.report.sections.joints.details import convergence, correlations, estimators, friction_maps
from davinci_forces.report.sections.joints.residuals import residual_blocks
from davinci_forces.report.sections.parts import explanation, is_of_link, of_free_motion, of_joint, run_name, section_of
from davinci_forces.report.verdicts import LIFTED_MASS, is_impossible

PARAMETER_HEADER = ("Parameter", "Unit", "Value", "Error from noise", "Error from model", "$z$")


@section_of("Joints", "joints")
def section(context: Context) -> Iterator[Block]:
    """One subsection per joint: the model that was used, then all fits beside it."""
    if fits := context.own_fits():
        yield Prose(explanation("joints"))
    joints = list(dict.fromkeys(fit.group for fit in fits))
    for joint in joints:
        content = joint_blocks(context, [fit for fit in fits if fit.group == joint])
        yield Section(title(joint), f"fit-{joint}", tuple(content))
    if links := tuple(link_parameters(context, joints)):
        yield Section("Links", "fit-links", links)


def joint_blocks(context: Context, fits: list[Fit]) -> Iterator[Block]:
    """The content about one joint."""
    joint = fits[0].group
    plain = next((f for f in fits if f"{f.model}.{f.estimator}" == context.own_fit(joint)), fits[0])
    used = context.used_record(joint) or plain
    yield equation(joint, used)
    yield parameters(context, joint, used)
    if LIFTED_MASS in of_joint(used, joint).values():
        yield Prose(explanation("joints-lifted-mass"))
    if used is not plain:
        yield Prose(compared_with_plain(context, joint, used, plain))
    model, _, by = (context.own_fit if used is plain else context.used_fit)(joint).partition(".")
    residuals = context.catalogue.select(Residual, joint=joint, model=model, estimator=by)
    for i, residual in enumerate(residuals):
        shown = tuple(residual_blocks(context, residual))
        if i == 0:
            yield from shown
        else:
            yield OnScreen(run_name(residual), f"residual-{residual.log}-{residual.joint}", shown)
    yield from unidentified_parameters(context, joint, used is plain)
    yield from implausible([used] if used is not plain else fits, joint)
    yield comparison(context, fits)


def equation(joint: str, fit: Fit) -> Equation:
    """The effort of a joint as the sum of the links' effort, if the arm is coupled, and of its own terms."""
    rows = of_joint(fit, joint)
    names = list(rows.values())
    terms = [f"theta_{number} {fit.phi[i]}".removesuffix(" 1") for number, i in enumerate(rows, start=1)]
    if any(map(is_of_link, fit.phi)):
        terms.insert(0, "sum_j beta_j Y_j (q, dot(q), dot.double(q))")
        names.insert(0, "the links' parameters (coupling to the other joints)")
    return Equation(f"tau = {' + '.join(terms)}", f"effort is the sum of {', '.join(names)}, each times its parameter")


def compared_with_plain(context: Context, joint: str, used: Fit, plain: Fit) -> str:
    """State what distinguishes the model in use from the joint by itself, and what it gains on unseen data."""
    base = {str(name) for name in plain.parameter}
    added = [name for name in of_joint(used, joint).values() if name not in base]
    row = context.efforts_of(used).index(joint)
    added = [f"“{name}”" if "," in name else name for name in added]
    changed = [f"it adds {as_list(added)}"] if added else []
    changed += ["it couples the joint to the others"] if any(map(is_of_link, used.phi)) else []
    if used.cutoff[row] != plain.cutoff[0]:
        passes = f"motion and effort pass a low-pass of {used.cutoff[row]:g} Hz"
        changed.append(f"{passes} instead of {plain.cutoff[0]:g} Hz")
    if used.effort_lag[row]:
        side = "after" if used.effort_lag[row] > 0 else "before"
        changed.append(f"the effort is taken {1e3 * abs(used.effort_lag[row]):g} ms {side} the motion")
    changed += [f"its estimator is {title_of(used.estimator)}"] if used.estimator != plain.estimator else []
    by = "least squares (LSE)" if plain.estimator == "lse" else title_of(plain.estimator)
    differences = "; ".join(changed) or "it has the same terms"
    text = f"Compared with the plain model (this joint alone, by {by}): {differences}."
    every, fit = context.catalogue.select(Prediction, joint=joint), context.used_fit(joint)
    predictions = [p for p in every if f"{p.model}.{p.estimator}" == fit]
    if all(p.role == "identification" for p in predictions):
        return text
    worst = max(of_free_motion(context, predictions), key=lambda p: p.relative_error)
    of_plain = f"predict.{worst.log}.{joint}.{plain.model}.{plain.estimator}.relative_error"
    before, std = context.number(of_plain, 3), context.results[of_plain].std or 0.0
    is_worse = worst.relative_error - context.results[of_plain].value > 2.0 * np.hypot(std, worst.relative_error_std)
    no_help = f' There the choice did not help: compare `fit = "{plain.model}.{plain.estimator}"` in study.toml.'
    after = context.number(f"{worst.prefix}.relative_error", 3)
    where = f"Of the logs not fitted, its relative residual (noise included) is largest in {literal(worst.log)}"
    return f"{text} {where}: {after}, and {before} by the plain model.{no_help * bool(is_worse)}"


def implausible(fits: list[Fit], joint: str) -> Iterator[Verdict]:
    """Each parameter that fits make negative although it is positive in every mechanism, once for all fits."""
    values: dict[str, list[tuple[float, float, str]]] = {}
    for fit in fits:
        for i, name in of_joint(fit, joint).items():
            if fit.theta[i] < 0 and fit.positive[i]:
                values.setdefault(name, []).append((fit.theta[i], fit.theta_std[i], title_of(fit.estimator)))
    for name, negative in values.items():
        clear = [each for each in negative if is_impossible(*each[:2])]
        value, std, _ = min(clear or negative, key=lambda each: each[0] + NORMAL_95 * each[1])
        who = ", ".join(dict.fromkeys(estimator for *_, estimator in clear or negative))
        follows = "which is physically impossible" if clear else "which cannot be distinguished from zero"
        text = f"**{literal(name)}** is negative ({Number(value, std=std, digits=2)}), {follows}, by {who}."
        yield Verdict("warn" if clear else "info", text)


def parameters(context: Context, joint: str, fit: Fit) -> Table:
    """The joint's parameters with their standard errors and how far they are from zero.  Tables 6.4-6.6"""
    rows = of_joint(fit, joint)
    table_rows = tuple(parameter_row(context, fit, i, f"$theta_{n}$", f" of {joint}") for n, i in enumerate(rows, 1))
    coupled = " The parameters of the links are in [@fit-links]." if len(rows) < len(fit) else ""
    mse = context.number(f"{'.'.join(('fit', *fit.key))}.mse", 3)
    # That of a fit to several joints would add efforts of several units.
    error = f" Mean squared error of the effort: {mse}." if fit.group == joint else ""
    logs, more = literal(", ".join(fit.logs)), f"{error}{scales(context, joint, fit)}{coupled}"
    source = f"Model: {fit.model}. Estimator: {title_of(fit.estimator)}. Data: {logs}."
    caption = f"Parameters of {name_in_sentence(joint)}. {source}{more}"
    return Table(caption, ("Symbol", *PARAMETER_HEADER), table_rows, f"theta-{joint}", "lllrrrr")


def scales(context: Context, joint: str, fit: Fit) -> str:
    """State the displacement or velocity within which frictions of a joint reverse or decay; "" without any."""
    parts = []
    for i, name in of_joint(fit, joint).items():
        if fit.scale[i] > 0.0:
            unit = "{position}" if name.startswith("presliding") else "{position}/s"
            size = Number(float(fit.scale[i]), format_unit(context.study.robot.joint(joint).unit(unit)), digits=3)
            parts.append(f"{size} ({name})")
    return f" Friction reverses or decays within {', '.join(parts)}." if parts else ""


def parameter_row(context: Context, fit: Fit, i: int, symbol: str, suffix: str = "") -> tuple[Cell, ...]:
    """One parameter with its standard errors."""
    name = str(fit.parameter[i])
    key = ".".join(("fit", *fit.key, slug(name)))
    z = fit.theta[i] / fit.theta_std[i] if fit.theta_std[i] > 0 else np.nan
    values = (context.number(f"{key}{part}", 2, unit="") for part in ("", ".std_noise", ".std_model"))
    unit = format_unit(fit.unit[i]) or "–"
    return symbol, literal(name.removesuffix(suffix)), unit, *values, in_format(z, ".1f")


def link_parameters(context: Context, joints: list[str]) -> Iterator[Block]:
    """The parameters of the links of each coupled model in use, which its joints share."""
    used = {fit.key: fit for joint in joints if (fit := context.used_record(joint)) is not None}
    for fit in used.values():
        rows = [i for i in range(len(fit)) if is_of_link(fit.phi[i])]
        if rows:
            moved = literal(", ".join(context.efforts_of(fit)).replace("_", " "))
            model, header = fit_name(fit.model, fit.estimator), ["", *PARAMETER_HEADER]
            caption = explanation("joints-links", group=fit.group, model=model, joints=moved)
            body = [parameter_row(context, fit, i, f"$beta_{n}$") for n, i in enumerate(rows, 1)]
            if np.isfinite(fit.described[rows]).any():
                header, caption = [*header, "Described"], f"{caption} {explanation('joints-links-described')}"
                described = (Number(x, digits=3).text for x in fit.described[rows].tolist())
                body = [(*cells, text) for cells, text in zip(body, described, strict=True)]
            yield Table(caption, tuple(header), tuple(body), f"links-{fit.group}", "lll" + "r" * (len(header) - 3))
            sums = tuple((literal(fit.parameter[i]), literal(fit.combination[i])) for i in rows if fit.combination[i])
            table = Table(explanation("joints-links-sums"), ("Parameter", "Sum"), sums, f"sums-{fit.group}", "ll")
            yield OnScreen("What the parameters of the links are sums of", f"links-sums-{fit.group}", (table,))


def comparison(context: Context, fits: list[Fit]) -> Block:
    """The joint by itself: parameters of all fits side by side, and how well each describes the data."""
    names = list(dict.fromkeys(name for fit in fits for name in fit.parameter))
    rows: list[tuple[Cell, ...]] = []
    for fit in fits:
        key = ".".join(("fit", *fit.key))
        values = (context.number(f"{key}.{slug(name)}", 3) for name in names)
        scores = context.numbers(key, ("mse", "r2", "condition"))
        rows.append((fit_name(fit.model, fit.estimator), *scores, *values))
    group = fits[0].group
    caption = explanation("joints-fits", joint=name_in_sentence(group))
    header = ("Fit", "MSE", "$R^2$", "Condition", *(name[:1].upper() + name[1:] for name in names))
    table = Table(caption, header, tuple(rows), f"fits-{group}", "l" + "r" * (len(header) - 1))
    diagnostics = context.catalogue.select(Diagnostic, stage="fit", subject=group)
    remarks = tuple(message(text) for diagnostic in diagnostics for text in diagnostic.text)
    more = (
        *([Bullets(remarks)] if remarks else []),
        *estimators(context, next((fit for fit in fits if fit.estimator == "lse"), fits[0])),
        *convergence(context, group),
        *correlations(context, group),
        *friction_maps(context, group),
    )
    return OnScreen(f"{title(group)}: all fits, and tests of them", f"all-fits-{group}", (table, *more))


def unidentified_parameters(context: Context, joint: str, is_used: bool) -> Iterator[Verdict]:
    """Parameters of the plain model that the identification logs of a joint do not determine."""
    for record in context.catalogue.select(Identifiability, group=joint):
        if text := "; ".join(map(message, (*record.together, *record.not_seen))):
            text = f"{text[:1].upper()}{text[1:]}" if is_used else f"In the plain model, {text}"
            yield Verdict("info", f"{text}. {record.advice}.")
