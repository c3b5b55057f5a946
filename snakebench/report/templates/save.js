"use strict";
// Tables are kept gzipped in the page; where the browser can unpack them they are saved as plain CSV.
document.addEventListener("click", async (event) => {
  const link = event.target.closest('a[download$=".csv.gz"]');
  if (!link || !window.DecompressionStream) return;
  event.preventDefault();
  const packed = Uint8Array.from(atob(link.href.split(",")[1]), (letter) => letter.charCodeAt(0));
  const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const saved = document.createElement("a");
  const blob = new Blob([await new Response(plain).arrayBuffer()], { type: "text/csv" });
  saved.setAttribute("href", URL.createObjectURL(blob));
  saved.download = link.download.replace(/\.gz$/, "");
  saved.click();
  setTimeout(() => URL.revokeObjectURL(saved.href), 1000);
});
