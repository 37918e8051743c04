
{
  const { decimals, columns, pictures, pairs } = JSON.parse(document.getElementById('gallery-data').textContent);
  const [gallery, flat, controls, dialog] = ['gallery', 'flat', 'controls', 'pair'].map(id => document.getElementById(id));
  const [material, method, sort, direction, count] =
    ['material', 'method', 'sort', 'direction', 'count'].map(id => document.getElementById(id));
  const [left, right, hidden, alone, previous, next] =
    ['left', 'right', 'hidden', 'alone', 'previous', 'next'].map(id => document.getElementById(id));
  const scenes = [...gallery.querySelectorAll('.scene')], cards = [...gallery.querySelectorAll('[data-pair]')];
  const homes = cards.map(card => card.parentElement);
  const of = card => pairs[card.dataset.pair];
  const small = picture => document.querySelector(`img[data-picture="${picture}"]`);
  const score = value => value.toFixed(decimals);
  const text = (value, column) => value === null ? '-' : column.rated ? score(value) : String(Number(value.toPrecision(4)));
  // The cards that are shown, in their order.
  let order = cards;

  const arrange = () => {
    const by = sort.value, grouped = by === 'material', down = direction.getAttribute('aria-pressed') === 'true';
    const column = columns[by], value = card => by === 'mos' ? of(card).mos : of(card).values[by];
    for (const card of cards) {
      const pair = of(card);
      card.hidden = (material.value && material.value !== pair.material) || (method.value && method.value !== pair.method);
      card.querySelector('.key').textContent = column ? `${column.name} ${text(value(card), column)}` : '';
      card.querySelector('.beside')?.remove();
      if (!grouped && pair.reference !== null) {
        const beside = small(pair.reference).cloneNode();
        beside.className = 'beside';
        beside.removeAttribute('data-picture');
        card.prepend(beside);
      }
    }
    if (grouped) {
      cards.forEach((card, i) => homes[i].append(card));
      gallery.append(...(down ? [...scenes].reverse() : scenes));
      for (const scene of scenes) scene.hidden = ![...scene.querySelectorAll('[data-pair]')].some(card => !card.hidden);
    } else {
      // Whatever the direction, what is missing comes last.
      flat.append(...[...cards].sort((a, b) => {
        const [x, y] = [value(a), value(b)];
        return x === null || y === null ? (x === null) - (y === null) : (down ? -1 : 1) * (x - y);
      }));
    }
    gallery.hidden = !grouped;
    flat.hidden = grouped;
    order = [...document.querySelectorAll('[data-pair]')].filter(card => !card.hidden);
    count.textContent = `${order.length} of ${cards.length} ${cards.length === 1 ? 'pair' : 'pairs'}`;
  };

  let at = 0;
  const fill = (figure, picture, name, camera) => {
    const caption = figure.querySelector('figcaption');
    caption.textContent = `${name}, ${camera}`;
    if (picture === null) return figure.replaceChildren('not rendered yet', caption);
    const { link, width, height } = pictures[picture], image = new Image(width, height), whole = document.createElement('a');
    image.alt = `${of(order[at]).material}, ${name}`;
    image.addEventListener('error', () => {
      image.src = small(picture).src;
      alone.hidden = false;
    }, { once: true });
    image.src = whole.href = link;
    whole.append(image);
    figure.replaceChildren(whole, caption);
  };
  const show = place => {
    at = Math.max(0, Math.min(place, order.length - 1));
    const pair = of(order[at]);
    document.getElementById('pair-name').textContent = `${pair.material}, ${pair.method}`;
    // A button that were disabled would lose the keyboard.
    previous.ariaDisabled = at === 0;
    next.ariaDisabled = at === order.length - 1;
    alone.hidden = true;
    if (hidden.checked) fill(left, pair.hidden, 'hidden reference', 'camera of the candidate');
    else fill(left, pair.reference, 'reference', 'its own camera');
    fill(right, pair.candidate, pair.method, 'camera of the candidate');
    const row = (name, value, what) => {
      const line = document.createElement('tr'), head = document.createElement('th');
      head.scope = 'row';
      head.textContent = name;
      line.append(head, ...[value, what].map(words => {
        const cell = document.createElement('td');
        cell.textContent = words;
        return cell;
      }));
      return line;
    };
    const rows = columns.map((column, i) => row(column.name, text(pair.values[i], column), column.what));
    dialog.querySelector('tbody').replaceChildren(row('MOS', score(pair.mos), 'as rated'), ...rows);
    for (const head of dialog.querySelectorAll('th[aria-sort]')) head.removeAttribute('aria-sort');
    // Whether the table is wider than the dialog is known now.
    dispatchEvent(new Event('resize'));
  };

  cards.forEach(card => card.addEventListener('click', event => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    if (!dialog.open) dialog.showModal();
    next.focus();
    dialog.scrollTop = 0;
    show(order.indexOf(card));
  }));
  previous.addEventListener('click', () => show(at - 1));
  next.addEventListener('click', () => show(at + 1));
  hidden.addEventListener('change', () => show(at));
  // To the pair that was shown last, not to that which was chosen first.
  const leave = () => {
    dialog.close();
    order[at].focus();
  };
  document.getElementById('close').addEventListener('click', leave);
  dialog.addEventListener('click', event => event.target === dialog && leave());
  dialog.addEventListener('keydown', event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = {
      ArrowLeft: () => show(at - 1),
      ArrowRight: () => show(at + 1),
      Escape: leave,
      h: () => hidden.click(),
    }[event.key === 'H' ? 'h' : event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  for (const choice of [material, method, sort]) choice.addEventListener('change', arrange);
  direction.addEventListener('click', () => {
    direction.setAttribute('aria-pressed', direction.getAttribute('aria-pressed') !== 'true');
    arrange();
  });
  // A browser keeps choices over a reload.
  arrange();
  controls.hidden = false;
}
