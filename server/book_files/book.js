"use strict";
// The book's search, its copy buttons, and the contents, which are open where there is room.

const MOST = 12; // results
const AROUND = 60; // letters of the text before what was found
const root = document.body.dataset.root;
const input = document.getElementById("search");
const found = document.getElementById("found");
const count = document.getElementById("count");
const list = found.querySelector("ul");
const contents = document.querySelector(".contents");
let sections; // a promise of the index, once somebody searches

const wide = matchMedia("(min-width: 900px)");
const openContents = () => {
  contents.open = wide.matches;
};
wide.addEventListener("change", openContents);
openContents();
if (wide.matches) document.querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });

function loadSections() {
  sections ??= fetch(`${root}search.json`).then((answer) => {
    if (!answer.ok) throw new Error(answer.statusText);
    return answer.json();
  });
  sections.catch(() => {
    sections = undefined;
  });
  return sections;
}

const plain = (text) => text.toLowerCase().replace(/[-_]/g, " ");
const wordsOf = (text) => plain(text).split(/\s+/).filter(Boolean);

/** How well a section has all the words: headings count more than text, neighbors more; 0 if it lacks one. */
function score([address, page, heading, text], words) {
  const parts = [
    [plain(heading), 12],
    [plain(page), 6],
    [plain(text), 1],
  ];
  let sum = 0;
  for (const word of words) {
    let points = 0;
    for (const [part, worth] of parts) {
      const at = part.indexOf(word);
      if (at >= 0) points += worth * (at === 0 || part[at - 1] === " " ? 2 : 1);
    }
    if (points === 0) return 0;
    sum += points;
  }
  const phrase = words.join(" ");
  for (const [part, worth] of parts) sum += part === phrase ? 8 * worth : part.includes(phrase) ? 2 * worth : 0;
  return address.startsWith("more/changes") ? sum / 4 : sum;
}

function excerpt(text, words) {
  const phrase = plain(text).indexOf(words.join(" "));
  const at = Math.max(0, (phrase < 0 ? plain(text).indexOf(words[0]) : phrase) - AROUND);
  const part = (at > 0 ? "…" : "") + text.slice(at, at + 3 * AROUND);
  const small = document.createElement("small");
  const escaped = words.map((word) => word.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
  for (const [number, piece] of part.split(new RegExp(`(${escaped.join("|")})`, "i")).entries()) {
    const node = number % 2 ? document.createElement("mark") : document.createTextNode(piece);
    if (number % 2) node.textContent = piece;
    small.append(node);
  }
  return small;
}

function show(entry, words) {
  const [address, page, heading, text] = entry;
  const item = document.createElement("li");
  const link = document.createElement("a");
  link.href = root + address;
  const strong = document.createElement("strong");
  strong.textContent = heading;
  link.append(strong, heading === page ? "" : ` · ${page}`, excerpt(text, words));
  item.append(link);
  return item;
}

async function search() {
  const words = wordsOf(input.value);
  found.hidden = words.length === 0;
  if (found.hidden) return;
  try {
    const scored = (await loadSections())
      .map((entry) => [score(entry, words), entry])
      .filter(([points]) => points > 0)
      .sort((a, b) => b[0] - a[0]);
    if (wordsOf(input.value).join(" ") !== words.join(" ")) return;
    list.replaceChildren(...scored.slice(0, MOST).map(([, entry]) => show(entry, words)));
    const sum = scored.length;
    count.textContent = sum === 0 ? "Nothing found." : sum > MOST ? `${sum} found; the best ${MOST}:` : `${sum} found`;
  } catch {
    list.replaceChildren();
    count.textContent = "The search needs the service, which does not answer.";
  }
}

input.addEventListener("input", search);
input.addEventListener("focus", search);

document.addEventListener("keydown", (event) => {
  const typing = event.target.matches("input, textarea, select");
  if (event.key === "/" && !typing && !event.ctrlKey && !event.metaKey && !event.altKey) {
    event.preventDefault();
    input.focus();
    input.select();
  } else if (event.key === "Escape" && !found.hidden) {
    input.focus();
    found.hidden = true;
  } else if (found.contains(event.target) || event.target === input) {
    moveByKeys(event);
  }
});

/** Arrow keys go through the results, Enter in the field opens the first. */
function moveByKeys(event) {
  const links = [...list.querySelectorAll("a")];
  const at = links.indexOf(event.target);
  if (event.key === "ArrowDown" && links[at + 1]) links[at + 1].focus();
  else if (event.key === "ArrowUp" && at >= 0) (links[at - 1] ?? input).focus();
  else if (event.key === "Enter" && event.target === input) links[0]?.click();
  else return;
  event.preventDefault();
}

document.addEventListener("pointerdown", (event) => {
  if (!event.target.closest("search")) found.hidden = true;
});

list.addEventListener("click", () => {
  found.hidden = true;
});

for (const block of document.querySelectorAll(".code")) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "Copy";
  button.addEventListener("click", async () => {
    const text = block.querySelector("code").textContent;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      copyBySelection(block.querySelector("code")); // no clipboard without https
    }
    button.textContent = "Copied";
    setTimeout(() => {
      button.textContent = "Copy";
    }, 2000);
  });
  block.append(button);
}

function copyBySelection(code) {
  const selection = getSelection();
  selection.selectAllChildren(code);
  document.execCommand("copy");
  selection.removeAllRanges();
}
