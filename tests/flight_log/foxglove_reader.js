// Reads an MCAP file with Foxglove's own readers and prints what they found as one JSON object:
// what the indexed and the streaming reader return, and every message decoded by its own schema.
import { createHash } from "node:crypto";
import { open, readFile } from "node:fs/promises";
import process from "node:process";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import lz4 from "@foxglove/wasm-lz4";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const [path] = process.argv.slice(2);
await lz4.isLoaded;
const decompressHandlers = { lz4: (data, size) => lz4(data, Number(size)) };

const file = await open(path);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, size) => {
    const data = new Uint8Array(Number(size));
    const { bytesRead } = await file.read(data, 0, data.length, Number(offset));
    if (bytesRead !== data.length) throw new Error(`${bytesRead} of ${size} bytes at ${offset}`);
    return data;
  },
};

const indexed = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const messages = [];
const decoders = new Map();
for await (const message of indexed.readMessages({ validateCrcs: true })) {
  const channel = indexed.channelsById.get(message.channelId);
  if (!decoders.has(channel.schemaId)) {
    const text = new TextDecoder().decode(indexed.schemasById.get(channel.schemaId).data);
    decoders.set(channel.schemaId, new MessageReader(parse(text, { ros2: true }), { timeType: "sec,nanosec" }));
  }
  messages.push({
    topic: channel.topic,
    log_ns: String(message.logTime),
    publish_ns: String(message.publishTime),
    sha1: createHash("sha1").update(message.data).digest("hex"),
    content: decoders.get(channel.schemaId).readMessage(message.data),
  });
}
const attachments = [];
for await (const one of indexed.readAttachments({ validateCrcs: true })) attachments.push(one.name);
const metadata = {};
for await (const one of indexed.readMetadata()) metadata[one.name] = Object.fromEntries(one.metadata);

const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(await readFile(path));
let streamed = 0;
for (let record = stream.nextRecord(); record; record = stream.nextRecord()) streamed += record.type === "Message";
await file.close();

const plain = (_, value) => {
  if (typeof value === "bigint") return String(value);
  return ArrayBuffer.isView(value) ? Array.from(value, (one) => plain(_, one)) : value;
};
const counted = Number(indexed.statistics.messageCount);
const whole = stream.done() && stream.bytesRemaining() === 0;
process.stdout.write(JSON.stringify({ messages, attachments, metadata, streamed, counted, whole }, plain));
