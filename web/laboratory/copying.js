// Buttons that copy a text of the page, such as a command, or the address of a link.

const element = (id) => document.getElementById(id);

export function startCopying(within = document, told = "copied") {
  for (const button of within.querySelectorAll("button.copy")) {
    const of = element(button.dataset.of);
    button.hidden = navigator.clipboard === undefined;
    button.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(of.href ?? of.textContent);
        element(told).textContent = "copied";
      } catch {
        element(told).textContent = "the browser does not allow copying from here";
      }
    });
  }
}
