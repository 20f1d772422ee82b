// Mark one element with text for each path of tags, classes and other attributes by which a style
// may select, and return the paths. Elements of one path have the same colours, in every row of a
// table and on every page, so that one of them suffices.
const [attributes, ids, seen] = arguments;
const sheets = [...document.styleSheets].map((each) => each.href?.replace(/.*\//, ""));
const paths = new Map([[document.documentElement, sheets.join()]]);
const old = new Set(seen), found = new Set();
for (const each of document.querySelectorAll("body, body *")) {
  const own = attributes.map((name) => each.getAttribute(name) ?? "").join("|")
    + (ids.includes(each.id) ? each.id : "");
  const path = `${paths.get(each.parentElement) ?? ""}>${each.tagName}|${own}`;
  paths.set(each, path);
  const text = [...each.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  if (text && !old.has(path) && !found.has(path) && each.checkVisibility()) {
    found.add(path);
    each.dataset.sample = "";
  }
}
return [...found];
