// Open the claim, sentence or entry that the address names, with all that is folded in it, and the
// group of an entry; a button opens or closes all of them.
(() => {
  const open = () => {
    const named = document.getElementById(location.hash.slice(1));
    if (!named?.matches(".claim, .sentence, .entry, .entries")) return;
    const inside = named.matches(".entries") ? [] : named.querySelectorAll("details");
    const group = named.closest(".entries") ?? named;
    for (const each of [group, named, ...inside]) each.open = true;
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
