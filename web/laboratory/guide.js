// The guided experiments: choose one, predict, run it, and read the explanation.
//
// The page has all of them as text. This script shows one at a time.

const all = (selector) => [...document.querySelectorAll(selector)];

// Start the guide; `run` gets the words of the state of an experiment.
export function startGuide(run) {
  const lessons = all(".lesson");
  const buttons = all("#lessons button");
  for (const lesson of lessons) {
    lesson.hidden = true;
    const answer = lesson.querySelector("details");
    const verdict = lesson.querySelector(".verdict-told");
    const link = lesson.querySelector("a.run");
    link.hidden = false;
    link.addEventListener("click", (event) => {
      event.preventDefault();
      const chosen = lesson.querySelector("input:checked");
      if (chosen === null) {
        verdict.textContent = "Choose a prediction first.";
        return;
      }
      const right = chosen.value === lesson.dataset.answer;
      const answered = lesson.querySelector(`input[value="${lesson.dataset.answer}"]`).closest("label");
      verdict.textContent = right
        ? "Your prediction was right."
        : `Your prediction was wrong. Right: ${answered.textContent.trim()}.`;
      answer.hidden = false;
      answer.open = true;
      run(link.hash);
      lesson.scrollIntoView();
    });
    answer.hidden = true;
  }
  for (const button of buttons) {
    button.addEventListener("click", () => {
      const isOpen = button.getAttribute("aria-expanded") === "true";
      for (const each of buttons) each.setAttribute("aria-expanded", String(each === button && !isOpen));
      for (const lesson of lessons) lesson.hidden = isOpen || lesson.id !== button.getAttribute("aria-controls");
    });
  }
  document.getElementById("lessons").hidden = false;
}
