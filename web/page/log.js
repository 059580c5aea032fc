// A log of the reader's own: dropped or chosen, mapped by suggestion where it has other names, estimated with the chosen car.

function logs(sensor, panel, result) {
  const messages = byId("log-messages");
  const mapping = byId("log-map");
  const map = mapping.querySelector("textarea");
  let log = null;

  // Takes a file: first with the names of the program, else with a first map.
  async function take(file) {
    say(`estimating ${file.name}`);
    log = { name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) };
    map.value = "";
    mapping.hidden = true;
    const answer = await estimated();
    if (!answer.error) return;
    const suggested = await sensor.readAside({ ask: "map", name: log.name }, log.bytes);
    if (suggested.error) return;
    map.value = suggested.map;
    mapping.hidden = false;
    const mapped = await estimated();
    mapping.open = Boolean(mapped.error);
  }

  const question = (ask) => ({ ask, car: panel.values.car, name: log.name, map: map.value.trim() ? map.value : null });

  async function estimated() {
    const asked = log;
    const answer = await sensor.readAside(question("log"), log.bytes);
    // Another one was dropped in the meantime.
    if (asked !== log) return {};
    if (answer.error) messages.replaceChildren(failed(answer));
    else {
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
  byId("file").addEventListener("change", (event) => event.target.files[0] && take(event.target.files[0]));
  mapping.querySelector("button").addEventListener("click", () => log && estimated());
  addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  addEventListener("dragleave", (event) => event.relatedTarget || document.body.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    const [file] = event.dataTransfer.files;
    if (file) take(file);
  });
}
