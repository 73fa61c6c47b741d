// The viewer: two pictures on one stage, wiped (the pointer moves the border) or flipped (click, space, or by itself).
(function () {
  var viewer = document.getElementById("viewer");
  if (!viewer) { return; }
  var stage = viewer.querySelector(".stage"), bar = viewer.querySelector(".bar");
  var layers = viewer.querySelectorAll(".stage .img"), selects = viewer.querySelectorAll("select");
  var label = viewer.querySelector("output"), mode = "wipe", at = 0.5, second = false, timer = 0;
  var width = Number(stage.dataset.width), height = Number(stage.dataset.height);
  function show() {
    selects.forEach(function (select, i) { layers[i].className = "img p" + select.value; });
    var name = function (i) { return selects[i].options[selects[i].selectedIndex].text; };
    var wipe = mode === "wipe";
    layers[1].style.visibility = wipe || second ? "visible" : "hidden";
    layers[1].style.clipPath = wipe ? "inset(0 0 0 " + 100 * at + "%)" : "none";
    bar.style.display = wipe ? "block" : "none";
    bar.style.left = 100 * at + "%";
    label.textContent = wipe ? name(0) + " | " + name(1) : name(second ? 1 : 0);
    viewer.querySelectorAll("button[data-mode]").forEach(function (b) {
      b.setAttribute("aria-pressed", String(b.dataset.mode === (timer ? "play" : mode)));
    });
  }
  function zoom(factor) {
    stage.style.width = width * factor + "px";
    stage.style.aspectRatio = width + " / " + height;
  }
  function flip() { second = !second; show(); }
  function setMode(next) {
    window.clearInterval(timer);
    timer = next === "play" ? window.setInterval(flip, 500) : 0;
    mode = next === "wipe" ? "wipe" : "flip";
    show();
  }
  stage.addEventListener("pointermove", function (e) {
    var box = stage.getBoundingClientRect();
    at = Math.min(1, Math.max(0, (e.clientX - box.left) / box.width));
    if (mode === "wipe") { show(); }
  });
  stage.addEventListener("click", function () { if (mode === "flip") { flip(); } });
  stage.addEventListener("keydown", function (e) {
    var step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[e.key];
    if (e.key === " ") { e.preventDefault(); setMode("flip"); flip(); }
    if (step) { at = Math.min(1, Math.max(0, at + step)); setMode("wipe"); }
  });
  selects.forEach(function (s) { s.addEventListener("change", show); });
  viewer.querySelectorAll("button[data-mode]").forEach(function (b) {
    b.addEventListener("click", function () { setMode(b.dataset.mode); });
  });
  viewer.querySelectorAll("button[data-zoom]").forEach(function (b) {
    b.addEventListener("click", function () { zoom(Number(b.dataset.zoom)); });
  });
  zoom(Number(stage.dataset.zoom));
  show();
})();
