// Light, dark, or as the system has it; figures follow.
const theme = (() => {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const followers = [];
  const buttons = [...document.querySelectorAll("[data-theme-choice]")];

  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : system.matches);
  const notify = () => followers.forEach((follow) => follow());

  function mark() {
    const choice = root.dataset.theme ?? "system";
    for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.themeChoice === choice);
  }

  function choose(choice, remember = true) {
    if (choice === "system") delete root.dataset.theme;
    else root.dataset.theme = choice;
    if (remember) try { localStorage.setItem("pivident-theme", choice); } catch { /* not kept */ }
    mark();
    notify();
  }

  for (const button of buttons) button.addEventListener("click", () => choose(button.dataset.themeChoice));
  system.addEventListener("change", notify);

  // On paper everything is light; afterwards it is as it was.
  let before;
  addEventListener("beforeprint", () => {
    before = root.dataset.theme ?? "system";
    choose("light", false);
  });
  addEventListener("afterprint", () => choose(before ?? "system", false));
  mark();

  return {
    isDark,
    follow: (follower) => followers.push(follower),
    variable: (name) => getComputedStyle(root).getPropertyValue(name).trim(),
  };
})();
