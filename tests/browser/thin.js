// Remove the elements of <main> whose structure has occurred before, on this page or on an earlier
// one, and return the structures that are new. A structure is a text: for an element and for all
// within it the tag, the names of the attributes, the values of those that rules of accessibility
// read, such as `role`, and whether there is text. The script keeps headings, elements that
// mark.js has marked, and in every table a row of each structure.
const known = new Set(arguments[0]), found = [];
const telling = /^(class|role|type|scope|tabindex|lang|aria-(?!label|describedby|controls).*)$/;
const shapes = new Map();
const shape = (each) => {
  if (!shapes.has(each)) {
    const own = [...each.attributes].filter(({ name }) => name !== "data-sample")
      .map(({ name, value }) =>
        telling.test(name) ? `${name}=${value}` : name + (value.trim() ? "" : "!"));
    const text = [...each.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
    const inside = each.tagName === "math" ? [] : new Set([...each.children].map(shape));
    shapes.set(each, `${each.tagName} ${own.sort()}${text ? "T" : ""}(${[...inside].sort()})`);
  }
  return shapes.get(each);
};
const thin = (whole, path, old, note) => {
  for (const each of [...whole.children]) {
    const here = `${path}>${shape(each)}`;
    if (/^H[1-6]$/.test(each.tagName)) continue;
    const marked = each.matches("[data-sample]") || each.querySelector("[data-sample]");
    if (old.has(here) && !marked) { each.remove(); continue; }
    old.add(here);
    note(here);
    const below = `${path}>${each.tagName}`;
    if (/^(DIV|SECTION|ARTICLE|UL|OL|LI|FIGURE)$/.test(each.tagName)) thin(each, below, old, note);
    else if (/^(TABLE|TBODY)$/.test(each.tagName)) thin(each, below, new Set(), () => {});
  }
};
shape(document.body);
const main = document.querySelector("main");
if (main) thin(main, "", known, (each) => found.push(each));
return found;
