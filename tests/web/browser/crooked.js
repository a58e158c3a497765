// What is crooked on a page, one line each: wider than the window, cut off, or one control on another.
() => {
  const wrong = [], root = document.documentElement, name = (node) => `${node.tagName.toLowerCase()}${node.id ? '#' + node.id : ''}${node.className ? '.' + node.className : ''} ${(node.ariaLabel || node.textContent).trim().slice(0, 24)}`;
  const isSeen = (node) => node.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && node.getBoundingClientRect().width > 1;
  if (root.scrollWidth > innerWidth) wrong.push(`the page is ${root.scrollWidth} wide in a window of ${innerWidth}`);
  const SCROLLS = '.wide, #list .frame, [data-wide]'; // sideways, on purpose
  for (const node of document.querySelectorAll('body *')) {
    const { overflowX } = getComputedStyle(node);
    if (/auto|scroll/.test(overflowX) && isSeen(node) && node.scrollWidth > node.clientWidth + 1 && !node.matches(SCROLLS + ', input, textarea')) wrong.push(`${name(node)} scrolls sideways by ${node.scrollWidth - node.clientWidth}`);
  }
  const controls = [...document.querySelectorAll('button, select, input, a, summary, [role=tab], .cell')].filter(isSeen);
  for (const node of controls) {
    const box = node.getBoundingClientRect();
    if (node.closest('.unseen')) continue;
    for (let at = node.parentElement; at; at = at.parentElement) {
      const { overflowX, overflowY } = getComputedStyle(at), room = at.getBoundingClientRect();
      const sideways = box.left < room.left - 1 || box.right > room.right + 1;
      if (/auto|scroll/.test(overflowX) && at.matches(SCROLLS)) break;
      if (/hidden|clip/.test(overflowX) && sideways) { wrong.push(`${name(node)} is cut off by ${name(at)}`); break; }
      if (/hidden|clip/.test(overflowY) && (box.top < room.top - 1 || box.bottom > room.bottom + 1)) { wrong.push(`${name(node)} is cut off by ${name(at)}`); break; }
      if (/auto|scroll/.test(overflowY)) break;
      if (at === document.body && (box.left < -1 || box.right > innerWidth + 1)) wrong.push(`${name(node)} is outside the window`);
    }
  }
  for (const bar of document.querySelectorAll('#bar, #head, #side nav, #charts > .bar, .chart header, #transport, .overlay, #tools, #parameter-views, .tools')) {
    const inside = controls.filter((node) => bar.contains(node)).map((node) => [node, node.getBoundingClientRect()]);
    inside.forEach(([one, a], i) => inside.slice(i + 1).forEach(([other, b]) => {
      if (one.contains(other)) return;
      if (Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1) wrong.push(`${name(one)} lies on ${name(other)}`);
    }));
  }
  const range = document.createRange();
  for (const cell of [...document.querySelectorAll('#table td:not([colspan], :first-child)')].filter(isSeen)) {
    range.selectNodeContents(cell); // what overflows a cell to its left does not make it scroll
    if (range.getBoundingClientRect().width > cell.clientWidth + 1) wrong.push(`${name(cell)} is wider than its column`);
  }
  return [...new Set(wrong)];
}
