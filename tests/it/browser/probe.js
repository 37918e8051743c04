// The first script of a copied page: when all is loaded it looks at it as a reader would, and tells the console.
addEventListener('load', () => setTimeout(() => {
  const root = document.documentElement, problems = new Set(), columns = {};
  let scrolling = 0;
  const short = element => element.outerHTML.replace(/\s+/g, ' ').slice(0, 80);
  for (const details of document.querySelectorAll('details')) details.open = true;

  for (const entry of performance.getEntriesByType('resource')) {
    if (!entry.name.startsWith('data:')) problems.add(`asked for ${entry.name}`);
  }
  for (const image of document.images) {
    if (!image.complete || !image.naturalWidth) problems.add(`no picture: ${short(image)}`);
  }
  for (const drawing of document.querySelectorAll('figure svg')) {
    if (!drawing.clientWidth || !drawing.clientHeight) problems.add(`no drawing: ${short(drawing)}`);
  }

  const [needed, given] = [root.scrollWidth, root.clientWidth];
  if (needed > given) problems.add(`too wide: ${needed} pixels in ${given}`);
  // The first column stays when a table is scrolled, and must leave room for the others.
  for (const pane of document.querySelectorAll('.table')) {
    const share = pane.querySelector('th').offsetWidth / pane.clientWidth;
    const scrolled = pane.scrollWidth > pane.clientWidth;
    if (scrolled && share > 0.6) problems.add(`little room in a table: ${short(pane)}`);
    // One that is wider than its pane says so, in words that stay in view and with a shadow; others do not.
    const hint = getComputedStyle(pane, '::before'), style = getComputedStyle(pane);
    const told = hint.content.includes('scroll') && hint.display !== 'none' && hint.position === 'sticky';
    if (scrolled && !told) problems.add(`does not say that it scrolls: ${short(pane)}`);
    if (scrolled && !style.backgroundImage.includes('gradient')) problems.add(`does not show that it scrolls: ${short(pane)}`);
    if (scrolled && !/auto|scroll/.test(style.overflowX)) problems.add(`cannot be scrolled: ${short(pane)}`);
    if (!scrolled && told) problems.add(`says that it scrolls, and does not: ${short(pane)}`);
    if (scrolled) scrolling += 1;
  }
  for (const text of document.querySelectorAll('dd')) {
    if (text.offsetWidth < 0.5 * text.parentElement.clientWidth) problems.add(`little room in a list: ${short(text)}`);
  }

  // Contrast of words as WCAG 2.2 defines it, which asks for 4.5 (1.4.3).
  const channels = colour => colour.match(/[\d.]+/g).map(Number);
  const linear = value => value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  const luminance = colour => {
    const [r, g, b] = channels(colour).map(value => linear(value / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = element => {
    const colour = getComputedStyle(element).backgroundColor;
    return channels(colour)[3] === 0 && element.parentElement ? behind(element.parentElement) : colour;
  };
  const words = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = words.nextNode(); node; node = words.nextNode()) {
    const element = node.parentElement;
    if (!node.data.trim() || !element.getClientRects().length || element.closest('svg')) continue;
    const [low, high] = [getComputedStyle(element).color, behind(element)].map(luminance).sort((a, b) => a - b);
    const contrast = (high + 0.05) / (low + 0.05);
    if (contrast < 4.5) problems.add(`contrast ${contrast.toFixed(1)}: ${short(element)}`);
  }

  // Every table by every column, up and down: numbers in order, words in order after them, no row lost.
  const number = text => {
    const found = /^[[<\s]*([-+\u2212]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)/i.exec(text);
    return found && Number(found[1].replace('\u2212', '-'));
  };
  const inOrder = (a, b, sign) => {
    const [x, y] = [number(a), number(b)];
    if (x === null && y === null) return sign * a.localeCompare(b) <= 0;
    return y === null || x !== null && sign * (x - y) <= 0;
  };
  for (const table of document.querySelectorAll('table')) {
    const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
    const rows = () => [...body.rows].map(row => row.textContent).sort().join('\n');
    const before = rows();
    heads.forEach((head, column) => {
      const name = `${table.caption.textContent} | ${head.textContent}`, button = head.querySelector('button');
      if (!button) return problems.add(`cannot be sorted: ${name}`);
      columns[name] = ['ascending', 'descending'].map((direction, turn) => {
        button.click();
        const marked = heads.filter(other => other.ariaSort);
        const cells = [...body.rows].map(row => row.cells[column].textContent);
        const ordered = cells.every((cell, i) => i === 0 || inOrder(cells[i - 1], cell, 1 - 2 * turn));
        const right = ordered && marked.length === 1 && head.ariaSort === direction && rows() === before;
        if (!right) problems.add(`not sorted, ${direction}: ${name}`);
        return cells;
      });
    });
  }

  const dark = matchMedia('(prefers-color-scheme: dark)').matches, pictures = document.images.length;
  console.log('SEEN ' + JSON.stringify({ width: innerWidth, dark, pictures, scrolling, problems: [...problems], columns }));
}));
