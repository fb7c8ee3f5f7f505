"use strict";
// Ratings of figures and runs, with comments, exported as review.toml. Nothing leaves the page but by that file.

const rated = JSON.parse(document.getElementById("Rated").textContent);
const ratings = rated.ratings.map((rating) => ({ ...rating }));
const VERDICTS = ["accept", "doubt", "reject"];
let unsaved = false;

// TOML's basic strings are JSON's, but for DEL and for halves of letters, which TOML has none of.
const tomlText = (text) =>
  JSON.stringify(text.replace(/[\ud800-\udbff](?![\udc00-\udfff])|(?<![\ud800-\udbff])[\udc00-\udfff]/g, "\ufffd")).replaceAll("\x7f", "\\u007f");

function reviewToml() {
  const lines = ["# Ratings of a report by davinci-forces: keep this file as review.toml beside study.toml."];
  const ofStudy = (rating) => rating.subject === "study";
  const verdict = ratings.findLast(ofStudy); // TOML has a single table [verdict]
  for (const rating of [...ratings.filter((rating) => !ofStudy(rating)), ...(verdict ? [verdict] : [])]) {
    if (rating === verdict) lines.push("", "[verdict]");
    else lines.push("", "[[rating]]", `${rating.subject} = ${tomlText(rating.name)}`);
    for (const key of ["verdict", "comment", "reviewer", "date", "results"]) lines.push(`${key} = ${tomlText(rating[key])}`);
  }
  return `${lines.join("\n")}\n`;
}

const ratingOf = (subject, name) =>
  ratings.findLast((rating) => rating.subject === subject && rating.name === name && rating.results === rated.results);

function rate(subject, name, verdict, comment, reviewer) {
  const own = ratingOf(subject, name);
  if (own) ratings.splice(ratings.indexOf(own), 1);
  if (verdict) ratings.push({ subject, name, verdict, comment, reviewer, date: new Date().toISOString().slice(0, 10), results: rated.results });
  unsaved = true;
  showRatings();
}

const form = newElement("dialog", "", { class: "rating", "aria-labelledby": "Rating-of" });
const heading = newElement("h2", "", { id: "Rating-of" });
const choice = newElement("select", "", { "aria-label": "Rating" });
choice.append(newElement("option", "no rating", { value: "" }), ...VERDICTS.map((verdict) => newElement("option", verdict, { value: verdict })));
const words = newElement("textarea", "", { rows: "4", placeholder: "Comment", "aria-label": "Comment" });
const reviewer = newElement("input", "", { placeholder: "Reviewer", "aria-label": "Reviewer", autocomplete: "name" });
const buttons = newElement("div", "", { class: "tools" });
form.append(heading, choice, words, reviewer, buttons);
document.querySelector("main").append(form);

let subjectNow = ["", ""];
function openRating(subject, name, title) {
  const own = ratingOf(subject, name);
  subjectNow = [subject, name];
  heading.textContent = `Rate ${title}`;
  choice.value = own?.verdict ?? "doubt";
  words.value = own?.comment ?? "";
  reviewer.value ||= own?.reviewer ?? "";
  form.showModal();
}
buttons.append(
  newButton("Keep", "", () => {
    rate(...subjectNow, choice.value, words.value, reviewer.value);
    form.close();
  }),
  newButton("Cancel", "", () => form.close()),
);

const panel = newElement("section", "", { class: "reviewing", "aria-label": "Your ratings" });
const runs = newElement("select", "", { "aria-label": "Run" });
runs.append(...rated.runs.map((run) => newElement("option", run)));
const list = newElement("ul");
const tools = newElement("div", "", { class: "tools" });
tools.append(
  runs,
  newButton("Rate this run", "", () => openRating("run", runs.value, `run ${runs.value}`)),
  newButton("Verdict on the study", "", () => openRating("study", "", "the study")),
  newButton("Export review.toml", "", () => {
    save(reviewToml(), "review.toml", "application/toml", "");
    unsaved = false;
  }),
);
panel.append(newElement("h2", "Your ratings"), list, tools,
  newElement("p", "Every figure has a button to rate it. Keep the exported review.toml beside study.toml: the next report shows it. It carries the hash of these results, and is no part of the report’s ID."));
document.querySelector("main").append(panel);

const figureButtons = new Map();
for (const figure of document.querySelectorAll("figure")) {
  const title = figure.querySelector("figcaption a").textContent.replace(/\W+$/, "");
  const button = newButton("Rate", `Rate ${title}`, () => openRating("figure", figure.id, title));
  figureButtons.set(figure.id, button);
  toolsOf(figure).append(button);
}

function showRatings() {
  for (const [name, button] of figureButtons) {
    const own = ratingOf("figure", name);
    button.textContent = own ? `Rated: ${own.verdict}` : "Rate";
  }
  list.replaceChildren(
    ...ratings.map((rating) => {
      const since = rating.results === rated.results ? "" : " (of earlier numbers)";
      return newElement("li", `${rating.subject} ${rating.name}: ${rating.verdict}${since}${rating.comment ? ` – ${rating.comment}` : ""}`);
    }),
  );
}
showRatings();
addEventListener("beforeunload", (event) => unsaved && event.preventDefault());
