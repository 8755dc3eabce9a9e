// The instant that a moving arm shows is a line over a figure over time: moving it redraws nothing.
/** Places the line at a time [s, on the figure's axis]; null takes it away. */
function markInstant(plot, t) {
  const axis = plot._fullLayout?.xaxis;
  let line = plot.querySelector(".instant");
  if (t === null || !axis?._length) { line?.remove(); return; }
  if (!line) {
    line = document.createElement("div");
    line.className = "instant";
    line.setAttribute("aria-hidden", "true");
    plot.append(line);
  }
  const x = axis.d2p(t);
  const { _size } = plot._fullLayout;
  line.hidden = !(x >= 0 && x <= axis._length);
  line.style.cssText = `transform: translateX(${axis._offset + x}px); top: ${_size.t}px; height: ${_size.h}px`;
}
