// A log of the reader's own: dropped or chosen, mapped by suggestion where it has other names, estimated with the chosen car.

function logs(sensor, panel, result) {
  const messages = byId("log-messages");
  const mapping = byId("log-map");
  const map = mapping.querySelector("textarea");
  let log = null;
  let dbc = null;

  // Takes files: the DBC of a bus, and a log.
  async function take(files) {
    const of = (isDbc) => [...files].find((file) => /\.dbc$/i.test(file.name) === isDbc);
    const [database, file] = [of(true), of(false)];
    if (database) dbc = { name: database.name, text: textOf(await database.arrayBuffer()) };
    if (file) log = { name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) };
    if (log) await taken();
    else if (database) say(`${database.name} is read: now drop the log`);
  }

  // A DBC is UTF-8, UTF-16 or Latin-1.
  function textOf(buffer) {
    const [first, second] = new Uint8Array(buffer);
    const wide = first === 0xff && second === 0xfe ? "utf-16le" : first === 0xfe && second === 0xff ? "utf-16be" : null;
    if (wide) return new TextDecoder(wide).decode(buffer);
    try {
      return new TextDecoder("utf-8", { fatal: true }).decode(buffer);
    } catch {
      return new TextDecoder("windows-1252").decode(buffer);
    }
  }

  // Estimates the log: first with the names of the program, else with a first map.
  async function taken() {
    say(`estimating ${log.name}`);
    map.value = "";
    mapping.hidden = true;
    const answer = await estimated({ isLast: false });
    if (!answer.error) return;
    const asked = log;
    const suggested = await sensor.readAside({ ask: "map", name: asked.name, dbc }, asked.bytes);
    if (asked !== log) return;
    if (suggested.error) {
      messages.replaceChildren(failed(suggested));
      return;
    }
    map.value = suggested.map;
    mapping.hidden = false;
    const mapped = await estimated();
    mapping.open = Boolean(mapped.error);
  }

  const question = (ask) => ({ ask, car: panel.values.car, name: log.name, map: map.value.trim() ? map.value : null, dbc });

  async function estimated({ isLast = true } = {}) {
    const asked = log;
    const answer = await sensor.readAside(question("log"), log.bytes);
    // Another one was dropped in the meantime.
    if (asked !== log) return {};
    if (answer.error && isLast) messages.replaceChildren(failed(answer));
    if (!answer.error) {
      const car = panel.cars.find(({ name }) => name === panel.values.car);
      const done = `${log.name} with “${car.title}”${map.value.trim() ? ", by the channel map below" : ""}:`;
      const button = make("button", { type: "button" }, "Save the estimates as CSV");
      const wanted = question("log_estimates");
      button.addEventListener("click", async () => {
        button.disabled = true;
        const text = await sensor.askAside(wanted, asked.bytes).catch(() => "");
        button.disabled = false;
        if (text) saveAs(text, "text/csv", log.name.replace(/(\.[^.]*)?$/, "_estimates.csv"));
      });
      messages.replaceChildren(make("p", {}, make("b", {}, done), " its drive is drawn above. ", button), ...sentences(answer.notes));
      result.take({ ...answer, notes: [] }, true);
      byId("figure").scrollIntoView({ block: "start" });
    }
    return answer;
  }

  const say = (words) => messages.replaceChildren(make("p", {}, words));
  byId("file").addEventListener("change", (event) => event.target.files.length && take(event.target.files));
  mapping.querySelector("button").addEventListener("click", () => log && estimated());
  addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  addEventListener("dragleave", (event) => event.relatedTarget || document.body.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    if (event.dataTransfer.files.length) take(event.dataTransfer.files);
  });
}
