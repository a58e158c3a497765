// What a page of somebody else tries from a browser that is signed in; run inside that page.
async ({ host, ports, page, routes, sockets, message, link }) => {
  const tried = { requests: 0, opened: [], forms: 0, frames: 0 };
  const bodies = [
    "{}",
    '{"name":"land"}',
    '{"action":"cut"}',
    new Blob([new Uint8Array(message)]),
    new URLSearchParams({ action: "cut", token: link.split("token=")[1] }),
  ];
  const asked = [];
  const ask = (address, options) => {
    tried.requests += 1;
    const limit = AbortSignal.timeout(4000);
    asked.push(
      fetch(address, { mode: "no-cors", credentials: "include", signal: limit, ...options }).catch(
        () => null,
      ),
    );
    return asked.length % 20 ? null : Promise.all(asked.splice(0));
  };
  for (const port of ports)
    for (const body of bodies) await ask(`http://${host}:${port}/`, { method: "POST", body });
  for (const route of routes) {
    const [method, path] = route.split(" ");
    if (method === "GET") await ask(`${page}${path}`, {});
    for (const body of method === "GET" ? [] : bodies) await ask(`${page}${path}`, { method: "POST", body });
  }
  await Promise.all(asked);
  const open = (address, protocol) =>
    new Promise((resolve) => {
      const socket = new WebSocket(address, protocol || []);
      const end = setTimeout(() => (socket.close(), resolve()), 3000);
      socket.onopen = () => {
        tried.opened.push(address);
        for (const body of ["{}", new Uint8Array(28), new Uint8Array(message)]) socket.send(body);
      };
      socket.onclose = () => (clearTimeout(end), resolve());
    });
  for (const port of ports) await open(`ws://${host}:${port}/`);
  await Promise.all(sockets.map(([path, protocol]) => open(page.replace("http", "ws") + path, protocol)));
  const inside = document.body.appendChild(document.createElement("iframe"));
  inside.name = "inside";
  for (const route of routes.filter((one) => !one.startsWith("GET"))) {
    const form = document.body.appendChild(document.createElement("form"));
    Object.assign(form, { method: "post", target: "inside", action: page + route.split(" ")[1] });
    for (const [name, value] of [
      ["action", "cut"],
      ["token", link.split("token=")[1]],
      ["replace", "1"],
    ])
      form.appendChild(Object.assign(document.createElement("input"), { name, value }));
    form.submit();
    tried.forms += 1;
    await new Promise((resolve) => setTimeout(resolve, 60));
  }
  for (const address of [`${page}/`, `${page}/emergency`, `${page}/viser/`, link]) {
    document.body.appendChild(document.createElement("iframe")).src = address;
    tried.frames += 1;
  }
  await new Promise((resolve) => setTimeout(resolve, 3000));
  return tried;
};
