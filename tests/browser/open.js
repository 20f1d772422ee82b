const [id] = arguments, named = document.getElementById(id);
const folded = [...(named.matches("details") ? [named] : []), ...named.querySelectorAll("details")];
const others = [...document.querySelectorAll(".claim, .sentence")].filter((each) => each !== named);
return {
  folded: folded.length,
  open: folded.filter((each) => each.open).length,
  others: others.filter((each) => each.open || each.querySelector("details[open]")).length,
  top: named.getBoundingClientRect().top,
};
