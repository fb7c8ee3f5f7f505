"use strict";
// Search: pages that lack a word are hidden, here and in the list.

const box = document.querySelector("#Search");
const articles = [...document.querySelectorAll("article")].map((page) => ({
  page, text: page.textContent.toLowerCase(), link: document.querySelector(`nav a[href="#${CSS.escape(page.id)}"]`),
}));
box.closest("label").hidden = false;
box.addEventListener("input", () => {
  const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0;
  for (const { page, text, link } of articles) {
    const fits = words.every((word) => text.includes(word));
    page.hidden = link.parentElement.hidden = !fits;
    count += fits;
  }
  for (const group of document.querySelectorAll("nav section")) group.hidden = !group.querySelector("li:not([hidden])");
  document.querySelector("#Found").textContent = words.length ? `${count} of ${articles.length} pages` : "";
});

const contents = document.querySelector("nav details");
const beside = matchMedia("(min-width: 80rem)");
const unfold = () => (contents.open = beside.matches);
beside.addEventListener("change", unfold);
unfold();
