// The page: figures are made when they are shown; keys go to the figure that was used last.

const figures = new Map();
let active = null;
const live = make("div", { class: "unseen", "aria-live": "polite" });

function announce(words) {
  clearTimeout(announce.later);
  announce.later = setTimeout(() => (live.textContent = words), 300);
}

function activate(figure) {
  if (active === figure) return;
  active?.root.classList.remove("active");
  active = figure;
  active?.root.classList.add("active");
}

const isOpen = (element) => !element.closest("details:not([open])");
const shifts = () => [...document.querySelectorAll("details.shift")];

// Makes the figures that are open, and drops those that are closed.
function update() {
  for (const element of document.querySelectorAll("div.figure")) {
    const there = figures.get(element);
    if (isOpen(element) && !there) figures.set(element, new Figure(element));
    if (!isOpen(element) && there) {
      if (active === there) activate(null);
      there.close();
      figures.delete(element);
    }
  }
}

// Opens a shift and closes the others.
function openShift(shift) {
  for (const other of shifts()) other.open = other === shift;
  update();
  const element = shift.querySelector("div.figure");
  if (element) activate(figures.get(element));
  shift.scrollIntoView({ block: "start" });
  shift.querySelector("summary").focus({ preventScroll: true });
}

// The next or the previous shift, from the one that is open.
function nextShift(by) {
  const all = shifts();
  const at = all.findIndex((shift) => shift.open);
  const next = all[at < 0 ? 0 : Math.min(Math.max(at + by, 0), all.length - 1)];
  if (next) openShift(next);
}

function openHash() {
  const target = document.getElementById(location.hash.slice(1));
  if (target?.matches("details.shift")) openShift(target);
}

// The figure that keys go to: the one that was used last, else the first that is visible.
function target() {
  const inSight = [...figures.values()].find(({ root }) => {
    const { top, bottom } = root.getBoundingClientRect();
    return bottom > 80 && top < innerHeight - 80;
  });
  return active ?? inSight ?? [...figures.values()][0];
}

const KEYS = {
  ArrowRight: (figure, { shiftKey }) => figure.step(shiftKey ? 20 : 1),
  ArrowLeft: (figure, { shiftKey }) => figure.step(shiftKey ? -20 : -1),
  "+": (figure) => figure.zoom(0.5),
  "=": (figure) => figure.zoom(0.5),
  "-": (figure) => figure.zoom(2),
  0: (figure) => figure.setView(...figure.whole),
  ",": (figure) => figure.pan(-0.25),
  ".": (figure) => figure.pan(0.25),
  n: () => nextShift(1),
  p: () => nextShift(-1),
  "?": () => showHelp(),
  Escape: () => activate(null),
};
const HELP = [
  ["← →", "move the cursor; with Shift by larger steps"],
  ["+ −", "zoom in and out; 0 shows the whole"],
  [", .", "move the view to the left and to the right"],
  ["n p", "next and previous shift"],
  ["drag", "zoom to a span of time; with Shift, or with one finger, move the view"],
  ["wheel, pinch", "zoom; the wheel works after a click into the figure, until Esc"],
  ["double click", "show the whole"],
];
const help = make("dialog", { "aria-label": "Keys" },
  make("h2", {}, "Keys"),
  make("dl", {}, ...HELP.flatMap(([key, does]) => [make("dt", {}, key), make("dd", {}, does)])),
  make("form", { method: "dialog" }, make("button", {}, "close")));
const showHelp = () => help.showModal();

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || help.open) return;
  if (event.target.closest("select, textarea, input:not([type=checkbox])")) return;
  const figure = target();
  if (!(event.key in KEYS) || !figure) return;
  event.preventDefault();
  KEYS[event.key](figure, event);
});
addEventListener("pointerdown", (event) => {
  if (active && !active.element.contains(event.target)) activate(null);
});
addEventListener("hashchange", openHash);

// Colours of another scheme need another drawing; paper gets a drawing on white.
dark.addEventListener("change", () => figures.forEach((figure) => figure.draw()));
addEventListener("beforeprint", () => figures.forEach((figure) => {
  const sheet = make("div", { class: "sheet" });
  sheet.innerHTML = svgOf(figure);
  figure.element.append(sheet);
}));
addEventListener("afterprint", () => document.querySelectorAll(".sheet").forEach((sheet) => sheet.remove()));

document.documentElement.classList.add("scripted");
document.querySelector("main").append(live, help);
for (const table of document.querySelectorAll("table.sortable")) {
  sortable(table);
  linked(table);
}
for (const details of document.querySelectorAll("details")) details.addEventListener("toggle", update);
update();
openHash();
