return arguments[0].map((each) => {
  const { left, right, top, bottom } = document.querySelector(each).getBoundingClientRect();
  return { left, right, top, bottom };
});
