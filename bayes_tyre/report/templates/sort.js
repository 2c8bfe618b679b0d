
"use strict";
// Every header cell becomes a button that sorts by its column; a second press turns the order round.
(function () {
  const words = new Intl.Collator("en", { numeric: true, sensitivity: "base" });

  function compare(a, b, kind) {
    return kind === "number" ? Number(a) - Number(b) : words.compare(a, b);
  }

  function sort(table, head, index) {
    const way = head.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
    for (const other of table.tHead.rows[0].cells) other.setAttribute("aria-sort", "none");
    head.setAttribute("aria-sort", way);
    const sign = way === "ascending" ? 1 : -1;
    const body = table.tBodies[0];
    const rows = Array.from(body.rows, (row) => ({ row, value: row.cells[index].dataset.value }));
    rows.sort((a, b) => {
      if (a.value === "" || b.value === "") return (a.value === "") - (b.value === ""); // empty last, either way
      return sign * compare(a.value, b.value, head.dataset.kind);
    });
    body.append(...rows.map((each) => each.row));
  }

  for (const table of document.querySelectorAll("table.sortable")) {
    Array.from(table.tHead.rows[0].cells).forEach((head, index) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      head.setAttribute("aria-sort", "none");
      button.addEventListener("click", () => sort(table, head, index));
    });
  }
})();
