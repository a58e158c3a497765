// Foxglove's own client of its websocket protocol. A line of JSON on the input is the call of one of
// its methods, [name, ...arguments]; a line on the output an event, [name, content].
import { createInterface } from "node:readline";
import process from "node:process";
import { parse } from "@foxglove/rosmsg";
import { MessageReader, MessageWriter } from "@foxglove/rosmsg2-serialization";
import protocol from "@foxglove/ws-protocol";
import WebSocket from "ws";

const [url, subprotocol] = process.argv.slice(2);
const client = new protocol.FoxgloveClient({ ws: new WebSocket(url, [subprotocol]) });
const channels = new Map(), services = new Map(), readers = new Map();
const parsed = (schema) => parse(schema, { ros2: true });
const plain = (key, value) => (typeof value === "bigint" ? String(value) : ArrayBuffer.isView(value) ? [...value] : value);
const tell = (name, content) => process.stdout.write(`${JSON.stringify([name, content], plain)}\n`);

for (const name of ["open", "serverInfo", "status", "parameterValues", "serviceCallFailure"]) client.on(name, (event) => tell(name, event));
client.on("error", (error) => tell("error", error.message));
client.on("close", ({ code, reason }) => { tell("close", { code, reason }); process.exit(); });
client.on("advertise", (all) => {
  for (const channel of all) channels.set(channel.topic, channel);
  tell("advertise", all.map(({ topic, schemaName, encoding, schemaEncoding }) => ({ topic, schemaName, encoding, schemaEncoding })));
});
client.on("advertiseServices", (all) => {
  for (const service of all) services.set(service.name, service);
  tell("advertiseServices", all.map(({ name, type }) => ({ name, type })));
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, reader } = readers.get(subscriptionId), bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  tell("message", { topic, timestamp, bytes, content: reader.readMessage(bytes) });
});
client.on("serviceCallResponse", ({ serviceId, callId, encoding, data }) => {
  const service = [...services.values()].find(({ id }) => id === serviceId);
  tell("serviceCallResponse", { callId, encoding, content: new MessageReader(parsed(service.response.schema)).readMessage(data) });
});

const calls = {
  subscribe(topic) {
    const channel = channels.get(topic), id = client.subscribe(channel.id);
    readers.set(id, { topic, reader: new MessageReader(parsed(channel.schema)) });
    tell("subscribed", id);
  },
  subscribeAll() { for (const topic of channels.keys()) calls.subscribe(topic); },
  subscribeChannel(id) { client.subscribe(id); },
  call(name, content, callId) {
    const { id, request } = services.get(name);
    client.sendServiceCallRequest({ serviceId: id, callId, encoding: "cdr", data: new MessageWriter(parsed(request.schema)).writeMessage(content) });
  },
};
for await (const line of createInterface({ input: process.stdin })) {
  const [name, ...values] = JSON.parse(line);
  (calls[name] ?? ((...all) => client[name](...all)))(...values);
}
client.close();
