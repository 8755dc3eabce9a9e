// Unpacks deflated bytes (RFC 1951) at once: printing does not wait for a DecompressionStream.
function inflate(bytes, size) {
  const out = new Uint8Array(size);
  let end = 0, at = 0, held = 0, bits = 0;

  /** The next bits as a number, the first one lowest. */
  function take(count) {
    while (held < count) { bits |= bytes[at++] << held; held += 8; }
    const value = bits & ((1 << count) - 1);
    bits >>>= count;
    held -= count;
    return value;
  }

  /** Canonical Huffman code: symbols by code, and by the first `FAST` bits as they arrive. */
  const FAST = 9;
  function codeOf(lengths) {
    const counts = new Uint16Array(16), next = new Uint16Array(16), begins = new Uint16Array(16);
    for (const length of lengths) counts[length] += 1;
    counts[0] = 0;
    for (let length = 1; length < 15; length += 1) begins[length + 1] = begins[length] + counts[length];
    next.set(begins);
    const symbols = new Uint16Array(lengths.length), fast = new Uint16Array(1 << FAST);
    lengths.forEach((length, symbol) => { if (length) symbols[next[length]++] = symbol; });
    for (let length = 1, code = 0; length <= FAST; length += 1, code <<= 1) {
      for (let k = 0; k < counts[length]; k += 1, code += 1) {
        let turned = 0;
        for (let bit = 0; bit < length; bit += 1) turned |= ((code >> bit) & 1) << (length - 1 - bit);
        for (let i = turned; i < 1 << FAST; i += 1 << length) fast[i] = (symbols[begins[length] + k] << 4) | length;
      }
    }
    return { counts, symbols, fast };
  }

  function symbolOf({ counts, symbols, fast }) {
    while (held < FAST && at < bytes.length) { bits |= bytes[at++] << held; held += 8; }
    const entry = fast[bits & ((1 << FAST) - 1)];
    if (entry && (entry & 15) <= held) {
      bits >>>= entry & 15;
      held -= entry & 15;
      return entry >> 4;
    }
    for (let length = 1, code = 0, first = 0, index = 0; length < 16; length += 1) {
      code |= take(1);
      if (code - counts[length] < first) return symbols[index + code - first];
      index += counts[length];
      first = (first + counts[length]) << 1;
      code <<= 1;
    }
    throw new Error("the drawing library is damaged: save the page again");
  }

  // Lengths of copies and how far back they begin: base and number of further bits.
  function steps(first, count, group) {
    const made = [];
    for (let k = 0, base = first; k < count; k += 1) {
      const more = k < 2 * group ? 0 : Math.floor(k / group) - 1;
      made.push([base, more]);
      base += 1 << more;
    }
    return made;
  }
  const LENGTHS = [...steps(3, 28, 4), [258, 0]], DISTANCES = steps(1, 30, 2);
  const ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];

  function codesOfBlock() {
    const literals = take(5) + 257, distances = take(5) + 1, given = take(4) + 4;
    const own = new Array(19).fill(0);
    for (let k = 0; k < given; k += 1) own[ORDER[k]] = take(3);
    const code = codeOf(own), lengths = [];
    while (lengths.length < literals + distances) {
      const symbol = symbolOf(code);
      if (symbol < 16) { lengths.push(symbol); continue; }
      const [value, times] = symbol === 16 ? [lengths.at(-1), 3 + take(2)]
        : symbol === 17 ? [0, 3 + take(3)] : [0, 11 + take(7)];
      for (let k = 0; k < times; k += 1) lengths.push(value);
    }
    return [codeOf(lengths.slice(0, literals)), codeOf(lengths.slice(literals))];
  }

  const FIXED = [
    codeOf(Array.from({ length: 288 }, (_, k) => (k < 144 ? 8 : k < 256 ? 9 : k < 280 ? 7 : 8))),
    codeOf(new Array(30).fill(5)),
  ];

  for (let last = 0; !last;) {
    last = take(1);
    const kind = take(2);
    if (kind === 0) {
      at -= held >> 3; // whole bytes that were read ahead
      bits = held = 0;
      const length = bytes[at] | (bytes[at + 1] << 8);
      out.set(bytes.subarray(at + 4, at + 4 + length), end);
      at += 4 + length;
      end += length;
      continue;
    }
    const [literal, distance] = kind === 1 ? FIXED : codesOfBlock();
    for (;;) {
      const symbol = symbolOf(literal);
      if (symbol < 256) { out[end++] = symbol; continue; }
      if (symbol === 256) break;
      const [base, more] = LENGTHS[symbol - 257];
      const length = base + take(more);
      const [far, further] = DISTANCES[symbolOf(distance)];
      const from = end - far - take(further);
      for (let k = 0; k < length; k += 1) out[end++] = out[from + k];
    }
  }
  return out;
}
