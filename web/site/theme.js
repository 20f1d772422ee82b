// What all pages do: the link to the content leaves the address alone, which may name more than a
// place. Dark or light: as the system has it, until the reader chooses. In the head, so that no page
// flashes in the other.
(() => {
  const root = document.documentElement;
  // The style hides what only a script can use, and folds the menu of a narrow screen.
  root.dataset.scripts = "";
  const system = window.matchMedia("(prefers-color-scheme: dark)");
  const kept = () => {
    // A page from a file may be refused a store.
    try {
      return localStorage.getItem("theme");
    } catch {
      return null;
    }
  };
  const keep = (theme) => {
    try {
      localStorage.setItem("theme", theme);
    } catch {
      // Then it holds for this page alone.
    }
  };
  if (["dark", "light"].includes(kept())) root.dataset.theme = kept();
  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";

  document.addEventListener("DOMContentLoaded", () => {
    const button = document.getElementById("theme");
    const show = () => {
      button.textContent = isDark() ? "light" : "dark";
      document.dispatchEvent(new Event("themechange"));
    };
    document.querySelector(".skip").addEventListener("click", (event) => {
      event.preventDefault();
      document.getElementById("main").focus();
    });
    const menu = document.getElementById("menu");
    menu.hidden = false;
    menu.addEventListener("click", () => {
      const isOpen = menu.getAttribute("aria-expanded") === "true";
      menu.setAttribute("aria-expanded", String(!isOpen));
    });
    button.hidden = false;
    button.addEventListener("click", () => {
      root.dataset.theme = isDark() ? "light" : "dark";
      keep(root.dataset.theme);
      show();
    });
    system.addEventListener("change", show);
    show();
  });
})();
