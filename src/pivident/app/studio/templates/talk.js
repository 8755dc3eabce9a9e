// Talking with the server: what is asked for, what it answers, what went wrong.
const talk = (() => {
  const said = document.getElementById("said");
  const words = said.querySelector("span");
  said.querySelector("button").addEventListener("click", () => { said.hidden = true; });

  /** Shows a message that stays until it is closed or the next request. */
  function say(text) {
    words.textContent = text;
    said.hidden = !text;
  }

  /** What the server answers, or null where it refused; the reason is shown. */
  async function send(method, to, body) {
    say("");
    let response;
    try {
      response = await fetch(to, {
        method,
        headers: body === undefined ? {} : { "Content-Type": "application/json" },
        body: body === undefined ? undefined : JSON.stringify(body),
      });
    } catch {
      say("The server does not answer; is pivident studio still running in its terminal?");
      return null;
    }
    const answer = await response.json().catch(() => ({ error: `the server answered ${response.status}` }));
    if (!response.ok) say(answer.error ?? `the server answered ${response.status}`);
    return response.ok ? answer : null;
  }

  /** Values of a form by name: lists of what may be chosen several times, and numbers as numbers. */
  function values(form) {
    const found = {};
    for (const field of form.elements) {
      if (!field.name || field.disabled) continue;
      if (field.type === "checkbox") {
        found[field.name] ??= [];
        if (field.checked) found[field.name].push(field.value);
      } else if (field.type === "radio") {
        if (field.checked) found[field.name] = field.value;
      } else if (field.type === "file") {
        found[field.name] = `${field.dataset.into}/${field.files[0]?.name}`;
      } else if (field.dataset.number !== undefined) {
        if (field.value.trim() !== "") found[field.name] = Number(field.value);
      } else found[field.name] = field.dataset.json === undefined ? field.value : JSON.parse(field.value);
    }
    return found;
  }

  /** What a form or a button sends. */
  function body(sender) {
    const { body: whole, more, step, field, arguments: given, goOn } = sender.dataset;
    if (whole) return JSON.parse(whole);
    if (sender.tagName !== "FORM") return {};
    const own = values(sender);
    if (step) return { step, arguments: { ...(given ? JSON.parse(given) : {}), ...own }, go_on: goOn !== undefined };
    if (field) return { [field]: Object.fromEntries(Object.entries(own).filter(([, value]) => value !== "")) };
    return { ...(more ? JSON.parse(more) : {}), ...own };
  }

  const listeners = [];
  const AGAIN = 700; // what follows sooner is the second half of a double click [ms]
  async function act(sender) {
    if (sender.hasAttribute("aria-busy")) return; // a change and its button, or a double click
    if (sender.dataset.confirm && !confirm(sender.dataset.confirm)) return;
    sender.setAttribute("aria-busy", "true");
    const method = sender.dataset.send;
    const files = [...sender.querySelectorAll("input[data-into]")];
    const brought = await Promise.all(files.map((field) => bring.into(field.dataset.into, field.files[0])));
    if (brought.includes(null)) return sender.removeAttribute("aria-busy");
    const answer = await send(method, sender.dataset.to, method === "DELETE" ? undefined : body(sender));
    if (answer?.to) location.assign(answer.to);
    else for (const listener of listeners) await listener(sender, answer);
    setTimeout(() => sender.removeAttribute("aria-busy"), AGAIN);
  }

  addEventListener("submit", (event) => {
    if (!event.target.dataset.send) return;
    event.preventDefault();
    act(event.target);
  });
  addEventListener("click", (event) => {
    const button = event.target.closest("button[data-send]");
    if (button) act(button);
  });

  return {
    say,
    send,
    /** Calls back with a form or button and the answer to what it sent, null where it was refused. */
    whenAnswered: (callback) => listeners.push(callback),
  };
})();
