// A click on a column's head sorts its table: numbers as numbers, what has none last.
const number = (text) => ({ inf: Infinity, "-inf": -Infinity })[text] ?? parseFloat(text);
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.ariaSort === "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.ariaSort = down ? "descending" : "ascending";
      const key = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent.trim();
      const order = (a, b) => {
        const [x, y] = [key(a), key(b)], [p, q] = [number(x), number(y)];
        if (isNaN(p) !== isNaN(q)) return isNaN(p) ? 1 : -1;
        const sign = isNaN(p) ? x.localeCompare(y) : Math.sign(p - q) || 0; // ∞ − ∞ is no number
        return (down ? -1 : 1) * sign;
      };
      body.append(...[...body.rows].sort(order));
    });
  });
}
