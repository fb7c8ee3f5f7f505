"""Records of pushes into tissue, and of haptic feedback."""

from collections.abc import Iterator

from davinci_forces.records.record import Column, Counts, Labels, LogRecord, Published, Record, RobotRecord

MAX_LISTED_PUSHES = 20  # up to this number of pushes in a log, results.json has each push


class Push(LogRecord):
    """One push into tissue: force against depth, the straight line through its contact, and the onset of contact."""

    KEY = ("log", "push")
    UNKNOWN = ("t", "x", "y", "z", "fitted")

    push: int
    contact: str  # "found", "stated", "all", or "contact from the first sample"
    k_t: float
    k_t_std: float
    k_t_std_model: float
    intercept: float
    r2: float
    onset_depth: float
    onset_depth_std: float
    release_depth: float
    t: Column
    depth: Column
    force: Column
    fitted: Column  # by the chosen model; NaN outside contact
    x: Column
    y: Column
    z: Column
    inside: Counts
    loading: Counts


class Stiffness(LogRecord):
    """The stiffness of the tissue of one log: the pushes, one a row, and their median."""

    ROWS = "push"
    UNKNOWN = (
        "k_t_std", "onset_depth", "onset_depth_std", "onset", "onset_std", "k_t_loading", "k_t_loading_std",
        "k_t_unloading", "k_t_unloading_std", "lost", "lost_std", "lost_share", "lost_share_std", "x", "y", "z",
    )  # fmt: skip

    source: str  # source of the force
    swings: int  # pushes examined
    stiffness: float
    stiffness_std: float
    stiffness_std_model: float
    stiffness_q1: float
    stiffness_q1_std: float
    stiffness_q3: float
    stiffness_q3_std: float
    pushes: int
    push: Counts
    counted: Counts
    k_t: Column
    k_t_std: Column
    r2: Column
    r2_std: Column
    onset_depth: Column
    onset_depth_std: Column
    onset: Column
    onset_std: Column
    k_t_loading: Column
    k_t_loading_std: Column
    k_t_unloading: Column
    k_t_unloading_std: Column
    lost: Column
    lost_std: Column
    lost_share: Column
    lost_share_std: Column
    x: Column
    y: Column
    z: Column

    def published(self) -> Iterator[Published]:
        """The median and quartiles over the pushes used, the number of these pushes, and each push if there are few."""
        yield from self.publish("tissue.{log}", "stiffness± stiffness_q1± stiffness_q3± pushes")
        if len(self) <= MAX_LISTED_PUSHES:
            names = "k_t± k_t_loading± k_t_unloading± r2± lost± lost_share± onset± onset_depth±"
            yield from self.publish("tissue.{log}.{name}", names)


class TissueModel(LogRecord):
    """The models of tissue for one log, and the one with the best prediction of left-out pushes."""

    ROWS = "law"
    PUBLISHED = ("tissue.{log}.{slug}: error± tangent± damping± exponent±",)

    chosen: str
    why: str
    middle: float
    law: Labels
    error: Column
    error_std: Column
    tangent: Column
    tangent_std: Column
    damping: Column
    damping_std: Column
    exponent: Column
    exponent_std: Column


class StabilityLimit(RobotRecord):
    """The largest stable tissue stiffness over the stiffness of the hand, without delay."""

    hand_mass: float
    hand_damping: float
    k_h: Column
    k_t_cqlf: Column
    k_t_switching: Column


class HandLimit(Record):
    """The largest stable tissue stiffness of one hand: the headline, its checks, and the best additional delay."""

    KEY = ("hand",)
    UNKNOWN = ("k_t_delay",)

    hand: str
    hand_mass: float
    hand_damping: float
    hand_stiffness: float
    link_rate: float
    k_t_limit: float
    k_t_limit_std: float
    k_t_response: float
    k_t_response_std: float
    k_t_simulated: float
    k_t_simulated_std: float
    k_t_settles: float
    k_t_settles_std: float
    k_t_cqlf: float
    k_t_switching: float
    limit_frequency: float
    filter_lag: float
    filter_lag_std: float
    filter_share: float
    filter_share_std: float
    loop_delay: float
    felt_damping: float
    best_delay: float
    k_t_best: float
    k_t_best_std: float
    damping_needed: float
    delay_margin: float
    delay: Column
    k_t_delay: Column

    def published(self) -> Iterator[Published]:
        """The hand and its limits, the headline and the filter with their errors."""
        measured = [name.removesuffix("_std") for name in self.scalars() if name.endswith("_std")]
        names = [name for name in self.scalars() if name != "hand" and name.removesuffix("_std") not in measured]
        return self.publish("stability.{hand}", " ".join((*names, *(f"{name}±" for name in measured))))


class HapticMotion(RobotRecord):
    """The motion of a hand against tissue beyond the limit of arbitrary switching, by switching law.  Fig 8.8, 8.10"""

    KEY = ("robot", "switching")

    switching: str
    tissue_stiffness: float
    t: Column
    hand_x: Column
    hand_dx: Column
    V: Column


class HapticResponse(RobotRecord):
    """The response of the felt force to the motion of a hand in the tissue, over frequency."""

    PUBLISHED = ("haptics: tissue_stiffness at_frequency rendered_stiffness transparency felt_delay",)

    arm_from: str
    scenario: str
    tissue_stiffness: float
    at_frequency: float
    rendered_stiffness: float
    transparency: float
    felt_delay: float
    frequency: Column
    felt_share: Column
    felt_late: Column


class HapticRun(Record):
    """One hand that moves in and out of the tissue, and its felt force.  Fig 8.12"""

    KEY = ("hand",)
    PUBLISHED = ("haptics.{hand}: out_of_reach true_peak felt_peak felt_error",)

    hand: str
    out_of_reach: int
    true_peak: float
    felt_peak: float
    felt_error: float
    t: Column
    plan_x: Column
    hand_x: Column
    arm_x: Column
    true_force: Column
    felt_force: Column
