// The tools of a page with cards: jump to a card, and keep the view in the address. This script runs
// before the cards are laid out, so that a view from the address does not move them.
(() => {
  "use strict";
  const view = () => document.querySelector("input[name=view]:checked").id.replace("view-", "");
  const asked = new URLSearchParams(location.search).get("view");
  const radio = asked && document.getElementById(`view-${asked}`);
  if (radio) radio.checked = true;

  // The first card below the tools. Another view keeps its place, though the heights of cards change.
  const tools = document.querySelector(".tools");
  let kept = null;
  const keep = () => {
    const below = tools.getBoundingClientRect().bottom;
    const target = document.querySelector(".line:target");
    const top = target?.getBoundingClientRect().top;
    const card = top >= below && top < innerHeight ? target
      : [...document.querySelectorAll(".line[id]")].find((each) => each.getBoundingClientRect().top >= below);
    kept = card && { card, top: card.getBoundingClientRect().top };
  };
  for (const event of ["pointerdown", "keydown"]) tools.addEventListener(event, keep);
  for (const each of document.querySelectorAll("input[name=view]")) {
    each.addEventListener("change", () => {
      if (kept && kept.top < innerHeight) {
        scrollBy(0, kept.card.getBoundingClientRect().top - kept.top);
      }
      const query = view() === "witness" ? "" : `?view=${view()}`;
      history.replaceState(null, "", location.pathname + query + location.hash);
    });
  }

  document.getElementById("jump").addEventListener("submit", (event) => {
    event.preventDefault();
    const numbers = [...document.querySelectorAll(".line[id]")].map((each) => Number(each.id));
    const told = document.getElementById("jumped");
    const given = document.getElementById("card").value.trim();
    const number = Number(given);
    if (numbers.includes(number)) {
      told.textContent = "";
      location.hash = `#${number}`;
      const card = document.getElementById(`${number}`);
      card.scrollIntoView();
      card.querySelector(".number").focus({ preventScroll: true });
    } else {
      const near = numbers.reduce((a, b) => (Math.abs(b - number) < Math.abs(a - number) ? b : a));
      told.textContent = /^\d+$/.test(given)
        ? `There is no card ${number}; the nearest is ${near}.`
        : `Give the number of a card, from ${numbers[0]} to ${numbers.at(-1)}.`;
    }
  });
})();
