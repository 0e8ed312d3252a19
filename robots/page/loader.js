// The scripts of this page are gzipped: unpack them, and run them one after the other.
(async () => {
  const pane = document.getElementById("meshcat-pane");
  const unpacked = (element) => {
    const bytes = Uint8Array.from(atob(element.textContent), (c) => c.charCodeAt(0));
    const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(plain).arrayBuffer();
  };
  if (innerWidth < 700) document.getElementById("legend").open = false;
  try {
    for (const element of document.querySelectorAll("script[data-packed]")) {
      const content = await unpacked(element);
      if (element.dataset.packed === "data") {
        globalThis[element.id] = content;
        continue;
      }
      const script = document.createElement("script");
      script.textContent = new TextDecoder().decode(content);
      document.body.append(script);
    }
    globalThis.shown = true;
    dispatchEvent(new Event("shown"));
  } catch (error) {
    pane.textContent = `This page needs WebGL and a browser of 2023 or later (${error}).`;
    throw error;
  }
})();
