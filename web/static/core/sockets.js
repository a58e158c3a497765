// Websockets that come back by themselves.

import { here } from "./vehicle_path.js";

const PAUSES = [0, 250, 500, 1000, 2000]; // ms
const PING = 1000; // ms
const LASTED = 1000; // ms that a connection was open, after which the next attempt is made at once
const FRAME = 120; // ms without a frame that add nothing to an age: three frames

const padded = (bytes) => 8 * Math.ceil(bytes / 8);

export class Socket extends EventTarget {
  socket;
  isClosed;

  constructor(path, { binary = false } = {}) {
    super();
    this.path = path;
    this.binary = binary;
    this.failures = 0;
    this.open();
  }

  get connected() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  open() {
    if (this.isClosed) return;
    const url = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${here(this.path)}`;
    this.socket = new WebSocket(url);
    if (this.binary) this.socket.binaryType = "arraybuffer";
    let opened = Infinity;
    this.socket.onopen = () => {
      opened = performance.now();
      this.dispatchEvent(new Event("open"));
    };
    this.socket.onmessage = (event) => this.dispatchEvent(new MessageEvent("message", { data: event.data }));
    this.socket.onclose = () => {
      this.dispatchEvent(new Event("close"));
      if (this.isClosed) return;
      this.failures = performance.now() - opened > LASTED ? 0 : Math.max(1, this.failures);
      const pause = PAUSES[Math.min(this.failures++, PAUSES.length - 1)];
      setTimeout(() => this.open(), pause);
    };
  }

  send(data) {
    if (this.connected) this.socket.send(data);
  }

  // For good.
  close() {
    this.isClosed = true;
    this.socket.close();
  }
}

// /ws/events: JSON messages by type, and the summary merged into one object.
export class Events extends Socket {
  constructor() {
    super("/ws/events");
    this.hello = null;
    this.summary = { age: {} };
    this.received = -Infinity;
    this.addEventListener("message", ({ data }) => {
      const message = JSON.parse(data);
      if (message.type === "summary") {
        Object.assign(this.summary, message);
        this.received = performance.now();
      }
      if (message.type === "hello") this.hello = message;
      this.dispatchEvent(new CustomEvent(message.type, { detail: message }));
    });
    this.addEventListener("close", () => {
      this.hello = null;
    });
  }

  // Who comes after the hello of this connection, as a panel whose script was slow, gets it too.
  on(type, listener) {
    this.addEventListener(type, ({ detail }) => listener(detail));
    const hello = type === "hello" && this.hello;
    if (hello) queueMicrotask(() => listener(hello));
  }

  // Age in seconds of a topic's newest message, running on while nothing arrives.
  age(topic) {
    const age = this.summary.age[topic];
    return age === null || age === undefined ? Infinity : age + (performance.now() - this.received) / 1e3;
  }
}

const HEAD = 24; // bytes, of a frame: see web/live/frames.py

// /ws/telemetry: see web/live/telemetry.py for what is asked for.
export class Telemetry extends Socket {
  constructor(description) {
    super("/ws/telemetry", { binary: true });
    this.order = description.topics;
    this.topicOf = new Map(description.signals.map(({ name, topic }) => [name, topic]));
    this.wants = new Map(); // who wants the newest values of which signals
    this.series = []; // of which every sample is wanted: { names, last, add(times, columns, holes) }
    this.origin = 0; // s, of the vehicle's epoch, from which times count
    this.names = [];
    this.topics = []; // of these, in the frame's order
    this.id = 0;
    this.ages = {}; // s by topic, when the newest frame came
    this.received = -Infinity;
    this.roundTrip = null; // s, between this page and web
    this.addEventListener("open", () => this.subscribe());
    this.addEventListener("close", () => {
      this.roundTrip = null;
    });
    this.addEventListener("message", ({ data }) =>
      typeof data === "string" ? this.pong(JSON.parse(data)) : this.read(data),
    );
    setInterval(() => this.send(`{"ping":${performance.now()}}`), PING);
  }

  want(who, names) {
    this.wants.set(who, names);
    this.subscribe();
  }

  chart(series) {
    this.series = series;
    this.subscribe();
  }

  subscribe() {
    this.names = [...new Set([...this.wants.values()].flat())];
    const all = [...this.names, ...this.series.flatMap(({ names }) => names)];
    const topics = new Set(all.map((name) => this.topicOf.get(name)));
    this.topics = this.order.filter((topic) => topics.has(topic));
    this.id = (this.id + 1) % 65536;
    const series = this.series.map(({ names, last }) => ({ signals: names, after: last }));
    this.send(JSON.stringify({ id: this.id, signals: this.names, origin: this.origin, series }));
  }

  read(buffer) {
    const view = new DataView(buffer);
    if (view.getUint16(0, true) !== this.id) return; // of the selection before
    const [parts, count, slowness] = [2, 4, 6].map((at) => view.getUint16(at, true)),
      age = {},
      value = {};
    const origin = view.getFloat64(8, true),
      time = view.getFloat64(16, true);
    this.topics.forEach((topic, i) => {
      const milliseconds = view.getUint16(HEAD + 2 * i, true);
      age[topic] = milliseconds === 65535 ? Infinity : milliseconds / 1e3;
    });
    let at = HEAD + padded(2 * this.topics.length);
    for (let i = 0; i < count; i++) value[this.names[i]] = view.getFloat32(at + 4 * i, true);
    at += padded(4 * count);
    if (origin !== this.origin) {
      this.origin = origin;
      this.dispatchEvent(new Event("origin"));
    }
    for (let i = 0; i < parts; i++) at = this.readSeries(buffer, at);
    this.ages = age;
    this.received = performance.now();
    this.dispatchEvent(new CustomEvent("frame", { detail: { time, slowness, age, value } }));
  }

  // Gives one of the series its new samples; where the next one begins.
  readSeries(buffer, start) {
    const [place, count, holes] = new Uint32Array(buffer, start, 3),
      series = this.series[place];
    let at = start + 16;
    const times = new Float64Array(buffer, at, count);
    at += 8 * count;
    const columns = series.names.map((_, k) => new Float32Array(buffer, at + 4 * k * count, count));
    at += padded(4 * count * series.names.length);
    const pairs = new Float64Array(buffer, at, 2 * holes);
    const told = Array.from({ length: holes }, (_, k) => ({ t: pairs[2 * k], count: pairs[2 * k + 1] }));
    series.add(times, columns, told);
    return at + 16 * holes;
  }

  // Age in seconds of a topic's newest message, running on while nothing arrives.
  age(topic) {
    const waited = performance.now() - this.received;
    return (this.ages[topic] ?? Infinity) + (waited > FRAME ? waited / 1e3 : 0);
  }

  pong({ pong }) {
    this.roundTrip = (performance.now() - pong) / 1e3;
    this.dispatchEvent(new CustomEvent("pong", { detail: this.roundTrip }));
  }
}
