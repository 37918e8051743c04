
for (const table of document.querySelectorAll('.table table')) {
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener('click', () => {
      const down = head.getAttribute('aria-sort') === 'ascending';
      heads.forEach(other => other.removeAttribute('aria-sort'));
      head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
      const key = row => row.cells[column] ? row.cells[column].textContent.trim() : '';
      // Of an interval the lower end, of `< 0.001` the bound.
      const number = text => parseFloat(text.replace('\u2212', '-').replace(/^[[<\s]+/, ''));
      const order = (a, b) => {
        const [x, y] = [number(key(a)), number(key(b))];
        // Whatever the direction, what is missing comes last.
        if (isNaN(x) !== isNaN(y)) return isNaN(x) ? 1 : -1;
        return (down ? -1 : 1) * (isNaN(x) ? key(a).localeCompare(key(b)) : x - y);
      };
      body.append(...[...body.rows].sort(order));
    });
  });
}

const panes = [...document.querySelectorAll('.table')];
const mark = () => panes.forEach(pane => pane.toggleAttribute('data-scrolls', pane.scrollWidth > pane.clientWidth));
addEventListener('resize', mark);
mark();
