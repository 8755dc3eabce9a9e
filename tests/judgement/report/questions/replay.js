// The moving picture: drawn, turned and played from the keyboard, readable without seeing it.
const canvas = document.querySelector(".replay canvas");
canvas.scrollIntoView({ behavior: "instant" });
await wait(300);
const inked = () => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let sum = 0, count = 0;
  for (let k = 0; k < data.length; k += 4) if (data[k + 3]) { count += 1; sum += (k % 9973) * data[k] + data[k + 2]; }
  return [count, sum];
};
const press = async (key) => {
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
  await wait(150);
};
const found = { pictures: [inked()], posture: [] };
const cells = () => [...document.querySelectorAll(".replay .posture tbody tr")].map((row) => row.cells[1].textContent);
found.posture.push(cells());
await press("ArrowLeft");
found.pictures.push(inked());
await press("+");
found.pictures.push(inked());
// Slowly, so that a busy machine does not come to the end.
document.querySelector(".replay [name=speed]").value = "0.1";
await press(" ");
found.playing = document.querySelector(".play").textContent;
await wait(500);
await press(" ");
found.paused = document.querySelector(".play").textContent;
found.moved = Number(canvas.dataset.instant);
found.pictures.push(inked());
found.posture.push(cells());
found.said = document.querySelector(".replay output").textContent;
return found;
