"use strict";
// The page in its pieces: every answer of the server brings them anew; those that changed are put in.

const shown = {};
const message = document.getElementById("message");
const told = document.getElementById("told");
const doing = document.getElementById("doing");
let open = 0; // requests that are not answered
let polling = null;
let asked = 0; // requests so far
let writing = null; // the pause after which a model that is written is taken
const edited = {}; // by field, the requests before it was filled in
const filled = new Map(); // by field, what was filled in; it outlives the piece with the field
const unfolded = new Map(); // by summary, whether its details are open

// every request is seen at once, however long its answer takes
async function send(method, path, body, what = "") {
  document.body.classList.add("busy");
  const number = ++asked;
  open += 1;
  if (what) doing.textContent = what;
  doing.hidden = !doing.textContent;
  try {
    const answer = await fetch(path, { method, body });
    await show(answer, number);
    return answer.ok;
  } catch (error) {
    say("The server does not answer. Is it still running?");
    return false;
  } finally {
    open -= 1;
    if (!open) {
      document.body.classList.remove("busy");
      doing.hidden = true;
      doing.textContent = "";
    }
  }
}

async function show(answer, number) {
  const kind = answer.headers.get("content-type") || "";
  const state = kind.includes("json") ? await answer.json() : { message: await answer.text() };
  say(state.message || "");
  for (const [name, html] of Object.entries(state.sections || {})) put(name, html, number);
  if (state.busy) poll();
  return state;
}

function say(text) {
  if (message.textContent === text) return;
  message.textContent = text;
  message.hidden = !text;
}

function put(name, html, number) {
  if (shown[name] === html) return;
  const section = document.getElementById(name);
  if (isSame(section, html)) {
    shown[name] = html; // a file may be about to be chosen in it
    return;
  }
  const focused = section.contains(document.activeElement) ? document.activeElement.id : "";
  section.querySelectorAll("details").forEach((d) => unfolded.set(d.querySelector("summary").textContent, d.open));
  const isNew = shown[name] !== undefined;
  const text = document.getElementById("model-text");
  const caret = text && focused === text.id ? [text.selectionStart, text.selectionEnd, text.scrollTop] : null;
  section.querySelectorAll("form [id]").forEach((f) => filled.set(f.id, f.value));
  section.innerHTML = html;
  if (name === "seen" || name === "work" || name === "model") {
    section.querySelectorAll("details").forEach((d) => { d.open = unfolded.get(d.querySelector("summary").textContent) ?? d.open; });
  }
  restore(section, name === "work" ? 0 : number);
  if (focused) document.getElementById(focused)?.focus({ preventScroll: true });
  if (caret && document.activeElement.id === text.id) {
    document.activeElement.setSelectionRange(caret[0], caret[1]);
    document.activeElement.scrollTop = caret[2];
  }
  shown[name] = html;
  if (name === "result" && html.trim() && isNew) {
    told.textContent = section.querySelector(".verdict b").textContent;
    section.scrollIntoView({ block: "start" });
  }
  if (name === "work") told.textContent = document.getElementById("stage")?.textContent || "";
}

function isSame(section, html) {
  const fresh = document.createElement("template");
  fresh.innerHTML = html;
  return fresh.innerHTML === section.innerHTML;
}

// what was filled in after the request was sent is not what its answer knows
function restore(section, number) {
  section.querySelectorAll("form [id]").forEach((f) => {
    if (filled.has(f.id) && (edited[f.id] ?? 0) >= number) f.value = filled.get(f.id);
  });
}

function poll() {
  if (polling !== null) return;
  polling = setTimeout(async () => {
    polling = null;
    const number = ++asked;
    try {
      await show(await fetch("sections"), number);
    } catch (error) {
      say("The server does not answer. Is it still running?");
    }
  }, 400);
}

// -- what is filled in ----------------------------------------------------------------------------

function mapping() {
  const filled = {};
  for (const field of document.querySelectorAll("#mapping [name]")) {
    if (field.name === "sample_time") filled.sample_time = field.value;
    else (filled[field.dataset.quantity] ||= {})[field.name] = field.value;
  }
  return filled;
}

function options() {
  return Object.fromEntries(new FormData(document.getElementById("options")));
}

function isWhole() {
  const columns = [...document.querySelectorAll("#mapping select[name=column]")];
  const sample = document.getElementById("sample-time");
  return columns.length > 0 && columns.every((c, k) => c.value || (k === 0 && sample && sample.value));
}

function look() {
  return send("POST", "look", JSON.stringify({ mapping: mapping() }));
}

const ACTIONS = {
  system: () => send("POST", "system", JSON.stringify({ system: document.getElementById("system").value }), "Making the model …").then(lookIfWhole),
  example: () => send("POST", "example", null, "Simulating a cart …").then(lookIfWhole),
  drop: (button) => send("DELETE", `records/${button.dataset.number}`).then(lookIfWhole),
  look,
  diagnose: () => send("POST", "diagnosis", JSON.stringify({ mapping: mapping(), options: options() })),
  goOn: () => send("POST", "go_on", null, "Taking the extended model …").then(lookIfWhole),
  stop: () => send("DELETE", "work"),
};

function lookIfWhole(done) {
  if (done && isWhole()) return look();
}

async function bring(to, files) {
  let done = true;
  for (const file of files) {
    const name = encodeURIComponent(file.name);
    done = (await send("POST", `${to}?name=${name}`, file, `Reading ${file.name} …`)) && done;
    if (!done) break;
  }
  await lookIfWhole(done);
}

// -- what is clicked, chosen and dropped -----------------------------------------------------------

document.addEventListener("click", async (event) => {
  const button = event.target.closest("[data-do]");
  if (!button || button.disabled) return;
  button.disabled = true;
  await ACTIONS[button.dataset.do](button);
  button.disabled = false;
});

document.addEventListener("change", (event) => {
  if (event.target.closest("[data-to]")) bringAll([...event.target.files]);
  else if (event.target.closest("#mapping")) isWhole() ? look() : remap(event.target);
});

document.addEventListener("input", (event) => {
  if (event.target.closest("form")) edited[event.target.id] = asked;
  if (event.target.id !== "model-text") return;
  clearTimeout(writing);
  writing = setTimeout(takeText, 600, event.target);
});

// what is written is a model as soon as one pauses
function takeText(field) {
  const name = encodeURIComponent(field.dataset.label);
  return send("POST", `model?name=${name}`, field.value).then(lookIfWhole);
}

// without a column for the time there is a field for the sample time: the server draws it
function remap(field) {
  if (field.dataset.quantity === "t" && field.name === "column") look();
}

document.addEventListener("submit", (event) => event.preventDefault());

for (const kind of ["dragenter", "dragover"]) {
  document.addEventListener(kind, (event) => {
    event.preventDefault();
    event.target.closest?.("[data-to]")?.classList.add("over");
  });
}
document.addEventListener("dragleave", (event) => event.target.closest?.("[data-to]")?.classList.remove("over"));
document.addEventListener("drop", (event) => {
  event.preventDefault();
  document.querySelectorAll(".over").forEach((each) => each.classList.remove("over"));
  bringAll([...event.dataTransfer.files]);
});

// wherever it is dropped, a YAML file is a model, and all else are records
async function bringAll(files) {
  const isModel = (file) => /\.ya?ml$/i.test(file.name);
  const models = files.filter(isModel), records = files.filter((file) => !isModel(file));
  if (models.length) await bring("model", models.slice(0, 1));
  if (records.length) await bring("records", records);
}

send("POST", "start");
