// Buttons that copy a text of the page, such as a command, or the address of a link.

const element = (id) => document.getElementById(id);

export function startCopying() {
  for (const button of document.querySelectorAll("button.copy")) {
    const of = element(button.dataset.of);
    button.hidden = navigator.clipboard === undefined;
    button.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(of.href ?? of.textContent);
        element("copied").textContent = "copied";
      } catch {
        element("copied").textContent = "the browser does not allow copying from here";
      }
    });
  }
}
