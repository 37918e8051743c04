// The first script of a copied page: when all is loaded it looks at it as a reader would, and tells the console.
addEventListener('load', () => setTimeout(async () => {
  const root = document.documentElement, problems = new Set(), columns = {}, pictures = document.images.length;
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

  const checkWidth = (element, what) => {
    const [needed, given] = [element.scrollWidth, element.clientWidth];
    if (needed > given) problems.add(`${what}: ${needed} pixels in ${given}`);
  };
  checkWidth(root, 'too wide');
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
  const checkContrast = part => {
    const words = document.createTreeWalker(part, NodeFilter.SHOW_TEXT);
    for (let node = words.nextNode(); node; node = words.nextNode()) {
      const element = node.parentElement;
      if (!node.data.trim() || !element.getClientRects().length || element.closest('svg')) continue;
      const [low, high] = [getComputedStyle(element).color, behind(element)].map(luminance).sort((a, b) => a - b);
      const contrast = (high + 0.05) / (low + 0.05);
      if (contrast < 4.5) problems.add(`contrast ${contrast.toFixed(1)}: ${short(element)}`);
    }
  };
  checkContrast(document.body);

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

  // A gallery: sorted by everything both ways, filtered, and a pair opened, left, compared and closed as with a keyboard.
  const visit = async () => {
    const [material, method, sort, direction, dialog, alone] =
      ['material', 'method', 'sort', 'direction', 'pair', 'alone'].map(id => document.getElementById(id));
    const { pairs } = JSON.parse(document.getElementById('gallery-data').textContent);
    const shown = () => [...document.querySelectorAll('[data-pair]')].filter(card => card.getClientRects().length);
    const names = () => shown().map(card => `${pairs[card.dataset.pair].material} ${pairs[card.dataset.pair].method}`);
    const choose = (select, value) => {
      select.value = value;
      select.dispatchEvent(new Event('change'));
    };
    const sorted = {};
    for (const { value, textContent } of [...sort.options]) {
      choose(sort, value);
      sorted[textContent] = [1, 2].map(() => {
        checkWidth(root, `too wide, sorted by ${textContent}`);
        checkContrast(document.body);
        const found = names();
        direction.click();
        return found;
      });
    }
    choose(sort, 'material');
    const filtered = [material, method].map(select => {
      choose(select, select.options[select.options.length - 1].value);
      const found = names();
      choose(select, '');
      return found;
    });
    choose(sort, 'mos');
    const look = async () => {
      const pictures = [...dialog.querySelectorAll('.both img')];
      await Promise.all(pictures.map(async picture => {
        // One that is not there gives way to a small one.
        await picture.decode().catch(() => new Promise(done => setTimeout(done, 200)));
        if (!picture.complete || !picture.naturalWidth) problems.add(`no picture in the dialog: ${short(picture)}`);
      }));
      checkWidth(dialog, 'the dialog is too wide');
      const { left, right } = dialog.getBoundingClientRect();
      if (left < 0 || right > root.clientWidth) problems.add(`the dialog is cut: ${left} to ${right}`);
      checkContrast(dialog);
      return {
        title: dialog.querySelector('h2').textContent,
        rows: [...dialog.querySelectorAll('tbody tr')].map(row => [...row.cells].map(cell => cell.textContent)),
        pictures: pictures.map(picture => picture.src.startsWith('data:') ? 'small' : picture.src.split('/').slice(-2).join('/')),
        alone: !alone.hidden,
      };
    };
    // A browser gives the keyboard to one of several frames alone, so that what the page asks for is looked at.
    let focused = null;
    const focus = HTMLElement.prototype.focus;
    HTMLElement.prototype.focus = function (...options) {
      focused = this;
      focus.apply(this, options);
    };
    const press = async key => {
      const holds = dialog.contains(focused) && focused.matches(':enabled') && focused.getClientRects().length;
      if (!holds) return problems.add(`the dialog has lost the keyboard before ${key}`);
      focused.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
      return dialog.open ? look() : null;
    };
    if (shown()[0].tabIndex < 0) problems.add('a card cannot be reached without a mouse');
    shown()[0].click();
    const opened = [await look()];
    for (const key of ['ArrowLeft', 'ArrowRight', 'h', 'ArrowLeft']) opened.push(await press(key));
    await press('Escape');
    return { sorted, filtered, opened, closed: !dialog.open, back: focused === shown()[0] };
  };
  const gallery = document.getElementById('gallery-data') && await visit();

  const dark = matchMedia('(prefers-color-scheme: dark)').matches;
  console.log('SEEN ' + JSON.stringify({ width: innerWidth, dark, pictures, scrolling, problems: [...problems], columns, gallery }));
}));
