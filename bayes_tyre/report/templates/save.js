"use strict";
// Below every figure a link that saves it as the file it is, SVG or PNG; the page holds its bytes once, in the image.
(function () {
  for (const image of document.querySelectorAll("figure img")) {
    const kind = image.src.startsWith("data:image/svg+xml") ? "svg" : "png";
    const link = document.createElement("a");
    link.className = "save";
    link.href = image.src;
    link.download = `${image.dataset.name}.${kind}`;
    link.textContent = `Save as ${kind.toUpperCase()}`;
    image.after(link);
  }
})();
