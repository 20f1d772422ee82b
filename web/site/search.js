// The search over cards, entries, claims, documents and the API; the words come with the page.
(() => {
  const MOST = 50;
  const SHOWN = 160; // letters of a text
  const query = document.getElementById("query");
  const results = document.getElementById("results");
  const count = document.getElementById("count");
  const places = window.searchData;
  const index = new MiniSearch({
    fields: ["title", "kind", "text"],
    searchOptions: {
      boost: { title: 3 },
      // The story and the page about the edition say first what others say in detail.
      boostDocument: (id) => (places[id].kind === "page" ? 4 : 1),
      // Another number is another place.
      prefix: (term) => !/\d/.test(term),
      fuzzy: (term) => (/\d/.test(term) ? false : 0.15),
      combineWith: "AND",
    },
  });
  index.addAll(places.map((place, id) => ({ id, ...place })));

  const entry = ({ href, title, kind, text }) => {
    const item = document.createElement("li");
    const link = document.createElement("a");
    link.href = href;
    link.textContent = title;
    const of = document.createElement("span");
    of.className = "muted";
    of.textContent = ` ${kind}: ${text.length > SHOWN ? `${text.slice(0, SHOWN)} …` : text}`;
    item.append(link, of);
    return item;
  };
  const show = () => {
    const words = query.value.trim();
    const found = words ? index.search(words) : [];
    results.replaceChildren(...found.slice(0, MOST).map(({ id }) => entry(places[id])));
    const more = found.length > MOST ? `, the first ${MOST} of them` : "";
    count.textContent = words ? `${found.length} ${found.length === 1 ? "place" : "places"}${more}` : `${places.length} places are known`;
    history.replaceState(null, "", words ? `#q=${encodeURIComponent(words)}` : "#");
  };
  const restore = () => {
    const words = new URLSearchParams(location.hash.slice(1)).get("q") ?? "";
    if (words !== query.value.trim()) query.value = words;
    show();
  };
  query.addEventListener("input", show);
  addEventListener("hashchange", restore);
  restore();
})();
