// The film as it stands in the page: base64 of zipped bytes, in which the header says what is where.

const ARRAYS = { f4: Float32Array, u4: Uint32Array, u1: Uint8Array };

class Film {
  constructor(bytes) {
    const length = new DataView(bytes).getUint32(0, true);
    this.bytes = bytes;
    this.start = 4 + length;
    this.header = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  }

  // a view, not a copy
  block({ at, count, type }) {
    return new ARRAYS[type](this.bytes, this.start + at, count);
  }
}

// what an element of the page holds; its text is let go, as it may be megabytes
async function unpacked(id) {
  const element = document.getElementById(id);
  const text = atob(element.textContent.trim());
  element.remove();
  const zipped = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i += 1) zipped[i] = text.charCodeAt(i);
  return new Response(new Blob([zipped]).stream().pipeThrough(new DecompressionStream("gzip")));
}

async function readFilm() {
  return new Film(await (await unpacked("film")).arrayBuffer());
}

// the page's policy knows this script by its digest
async function loadViewer() {
  const script = document.createElement("script");
  script.textContent = await (await unpacked("viewer-script")).text();
  document.head.append(script);
}
