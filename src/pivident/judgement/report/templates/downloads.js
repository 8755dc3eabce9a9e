// Files that the page carries, handed out as such.
(() => {
  for (const link of document.querySelectorAll("a[data-file]")) {
    const holder = document.getElementById(link.dataset.file);
    const text = JSON.parse(holder.textContent);
    link.href = URL.createObjectURL(new Blob([text], { type: holder.dataset.type }));
  }
})();
