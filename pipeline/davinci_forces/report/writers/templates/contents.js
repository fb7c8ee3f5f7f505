"use strict";
// Contents that show where the reader is, and that are folded where there is no room beside the text.

const contents = document.querySelector("nav details");
const beside = matchMedia("(min-width: 80rem)");
const unfold = () => (contents.open = beside.matches);
beside.addEventListener("change", unfold);
unfold();

const links = new Map([...contents.querySelectorAll("a")].map((link) => [link.hash.slice(1), link]));
const seen = new Set();
const reading = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) isIntersecting ? seen.add(target) : seen.delete(target);
  const sections = [...seen].map((section) => section.getAttribute("aria-labelledby")).filter((name) => links.has(name));
  const order = [...links.keys()];
  const current = links.get(sections.sort((a, b) => order.indexOf(b) - order.indexOf(a))[0]);
  for (const link of links.values()) link.removeAttribute("aria-current");
  if (!current) return;
  current.setAttribute("aria-current", "true");
  const list = contents.closest("nav");
  if (beside.matches) list.scrollTop = current.offsetTop - list.clientHeight / 2;
}, { rootMargin: "-15% 0px -75% 0px" });
for (const section of document.querySelectorAll("section[aria-labelledby]")) reading.observe(section);

contents.addEventListener("click", (event) => {
  if (event.target.closest("a") && !beside.matches) contents.open = false;
});
