// Metrics and settings. Long ones begin closed.

const LONG = 14; // rows
const NUMBER = /^[+\u2212-]?[\d.]\S*( \S+)?$/; // with its unit, if it has one

function tables(film) {
  const found = film.header.tables || [];
  const place = document.getElementById("tables");
  place.hidden = found.length === 0;
  place.append(...found.map(tableOf));
}

function tableOf({ title, columns, rows, marked = [] }) {
  const details = document.createElement("details");
  details.open = rows.length <= LONG;
  const scroll = document.createElement("div");
  scroll.className = "scroll";
  const table = document.createElement("table");
  if (columns.some((name) => name)) table.createTHead().append(rowOf(columns, ["th", "th"], "col"));
  table.createTBody().append(...rows.map((row) => rowOf(row, ["th", "td"], "row")));
  for (const row of marked) table.tBodies[0].rows[row].className = "beyond";
  scroll.append(table);
  details.append(textElement("summary", title), scroll);
  return details;
}

function rowOf(cells, [first, other], scope) {
  const row = document.createElement("tr");
  cells.forEach((text, i) => {
    const cell = textElement(i === 0 ? first : other, text);
    if (cell.tagName === "TH") cell.scope = i === 0 ? scope : "col";
    else if (NUMBER.test(text)) cell.className = "number";
    row.append(cell);
  });
  return row;
}

function textElement(tag, text) {
  const element = document.createElement(tag);
  element.textContent = text;
  return element;
}
