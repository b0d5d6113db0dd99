"use strict";
// Unpacks the modules of this page, points their imports at each other, and starts the last.

// No content policy that browsers know so far forbids these a connection; so they go first.
for (const name of ["RTCPeerConnection", "webkitRTCPeerConnection", "mozRTCPeerConnection"]) {
  Object.defineProperty(window, name, { value: undefined });
}

(async () => {
  const unpack = async (element) => {
    const bytes = Uint8Array.from(atob(element.textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  };
  try {
    const packed = [...document.querySelectorAll("script.module")];
    const texts = await Promise.all(packed.map(unpack));
    const places = {};
    let last = "";
    packed.forEach((element, index) => {
      const text = new TextDecoder().decode(texts[index]);
      const linked = text.replace(/\bfrom (['"])([^'"\n]+)\1/g, (whole, quote, name) => {
        const file = name === "three" ? "three.module.js" : name.split("/").pop();
        return places[file] ? `from "${places[file]}"` : whole;
      });
      last = URL.createObjectURL(new Blob([linked], { type: "text/javascript" }));
      places[element.dataset.name] = last;
    });
    const page = await import(last);
    const about = JSON.parse(document.getElementById("about").textContent);
    page.start(about, new Float32Array(await unpack(document.getElementById("data"))));
  } catch (error) {
    const box = document.getElementById("problem");
    box.textContent = `This view could not start: ${error.message}`;
    box.hidden = false;
    throw error;
  }
})();
