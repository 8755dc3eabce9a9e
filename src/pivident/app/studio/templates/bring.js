// Files from the reader's disk, one after the other, with their progress.
const bring = (() => {
  /** Sends a file; true where it has arrived. */
  function put(file, to, progress) {
    return new Promise((done) => {
      const request = new XMLHttpRequest();
      request.open("PUT", to);
      request.upload.addEventListener("progress", (event) => {
        if (event.lengthComputable) progress.value = event.loaded / event.total;
      });
      request.addEventListener("loadend", () => {
        let answer = {};
        try { answer = JSON.parse(request.responseText); } catch { /* no answer */ }
        if (request.status !== 200) talk.say(answer.error ?? "The file did not arrive; is pivident studio still running?");
        done(request.status === 200 ? answer : null);
      });
      request.send(file);
    });
  }

  const encoded = (path) => path.split("/").map(encodeURIComponent).join("/");

  /** Brings files, given as pairs of a path and a file; a bag is a folder. */
  async function all(form, files) {
    const progress = form.querySelector("progress");
    const there = [...document.querySelectorAll("[data-file]")].map(({ dataset }) => dataset.file);
    const taken = files.map(([path]) => path).filter((path) => there.includes(path));
    if (taken.length && !confirm(`Replace ${taken.join(", ")}?`)) return;
    const address = document.getElementById("project")?.dataset.address ?? await created(files);
    if (!address) return;
    talk.say("");
    progress.hidden = false;
    for (const [path, file] of files) {
      progress.value = 0;
      await put(file, `${address}/files/${encoded(path)}`, progress);
    }
    progress.hidden = true;
    if (document.getElementById("project")) listeners.forEach((listener) => listener());
    else location.assign(address);
  }

  /** Address of a new project for files that were dropped where there is none yet. */
  async function created(files) {
    const field = document.getElementById("new-name");
    const robot = files.find(([path]) => /\.(urdf|xml|mjcf|toml)(\.gz)?$/i.test(path)) ?? files[0];
    const stem = robot[0].split("/").pop().replace(/\..*$/, "");
    return (await talk.send("POST", "/projects", { name: field.value.trim() || stem }))?.to;
  }

  /** Files of what was dropped, those of folders with the folder's name. */
  async function dropped(transfer) {
    const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
    if (!entries.length) return [...transfer.files].map((file) => [file.name, file]);
    const found = [];
    for (const entry of entries) {
      if (entry.isFile) found.push([entry.name, await new Promise((done, no) => entry.file(done, no))]);
      else {
        const reader = entry.createReader();
        for (;;) { // a reader gives a hundred at a time
          const inside = await new Promise((done, no) => reader.readEntries(done, no));
          if (!inside.length) break;
          for (const one of inside.filter((each) => each.isFile)) {
            found.push([`${entry.name}/${one.name}`, await new Promise((done, no) => one.file(done, no))]);
          }
        }
      }
    }
    return found;
  }

  addEventListener("change", async (event) => {
    const form = event.target.closest("[data-bring]");
    if (!form || event.target.type !== "file") return;
    const files = [...event.target.files].map((file) => [file.name, file]);
    event.target.value = "";
    await all(form, files);
  });
  addEventListener("dragover", (event) => {
    event.preventDefault(); // a file beside the field must not replace the page
    document.querySelector("[data-bring]")?.classList.add("over");
  });
  const away = () => document.querySelector("[data-bring]")?.classList.remove("over");
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) away(); });
  addEventListener("drop", async (event) => {
    event.preventDefault();
    away();
    const form = document.querySelector("[data-bring]");
    const files = form ? await dropped(event.dataTransfer) : [];
    if (files.length) await all(form, files);
  });

  addEventListener("submit", async (event) => {
    const form = event.target;
    if (!form.dataset.archive) return;
    event.preventDefault();
    const progress = form.querySelector("progress");
    progress.hidden = false;
    const name = encodeURIComponent(form.elements.name.value);
    const answer = await put(form.elements.file.files[0], `${form.dataset.archive}?name=${name}`, progress);
    progress.hidden = true;
    if (answer?.to) location.assign(answer.to);
  });
  addEventListener("change", ({ target }) => {
    const own = target.form;
    if (own?.dataset.archive && target.type === "file" && !own.elements.name.value) {
      own.elements.name.value = (target.files[0]?.name ?? "").replace(/\.zip$/i, "");
    }
  });

  const listeners = [];
  return {
    /** Brings a file into a folder of the project; null where it is refused. */
    into: (folder, file) => {
      const { address } = document.getElementById("project").dataset;
      return put(file, `${address}/files/${encoded(`${folder}/${file.name}`)}`, document.createElement("progress"));
    },
    /** Calls back when files have come. */
    whenBrought: (callback) => listeners.push(callback),
  };
})();
