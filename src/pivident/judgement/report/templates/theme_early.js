// Before anything is painted: the colours that the reader chose last time.
document.documentElement.classList.add("scripted");
try {
  const chosen = localStorage.getItem("pivident-theme");
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
} catch { /* a page without storage follows the system */ }
