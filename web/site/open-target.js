// Open the claim, sentence or entry that the address names, with all that is folded in it; a button
// opens or closes all of them.
(() => {
  const open = () => {
    const named = document.getElementById(location.hash.slice(1));
    if (!named?.matches(".claim, .sentence, .entry")) return;
    for (const each of [named, ...named.querySelectorAll("details")]) each.open = true;
    named.scrollIntoView();
  };
  addEventListener("hashchange", open);
  open();

  for (const button of document.querySelectorAll(".open-all")) {
    button.hidden = false;
    button.addEventListener("click", () => {
      const opens = button.textContent === "Open all";
      for (const each of document.querySelectorAll(button.dataset.of)) each.open = opens;
      button.textContent = opens ? "Close all" : "Open all";
    });
  }
})();
