// Open what is folded in the claim or sentence that the address names.
(() => {
  const open = () => {
    const named = document.getElementById(location.hash.slice(1));
    if (!named?.matches(".claim, .sentence")) return;
    for (const each of named.querySelectorAll("details")) each.open = true;
    named.scrollIntoView();
  };
  addEventListener("hashchange", open);
  open();
})();
