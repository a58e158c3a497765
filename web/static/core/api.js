// Requests to our own API. An error's message is the one line the server gave.

import { here } from "./vehicle_path.js";

/** @param {string} path @param {RequestInit} [how] */
async function answer(path, how) {
  const response = await fetch(here(path), how).catch(() => {
    throw new Error("this page's server does not answer; is it running?");
  });
  if (response.ok) return response;
  const { error = `error ${response.status}` } = await response.json().catch(() => ({}));
  throw Object.assign(new Error(error), { status: response.status });
}

// body: sent as JSON, or as it is where `type` names its content type.
/** @param {string} method @param {string} path @param {any} [body] @returns {Promise<any>} */
export async function request(method, path, body, type = "") {
  const headers = { "Content-Type": type || "application/json" };
  const response = await answer(
    path,
    body === undefined ? { method } : { method, headers, body: type ? body : JSON.stringify(body) },
  );
  return response.json().catch(() => ({}));
}

// An answer of numbers, or of a file.
/** @param {string} path @param {RequestInit} [how] @returns {Promise<ArrayBuffer>} */
export const binary = async (path, how) => (await answer(path, how)).arrayBuffer();

/** @param {string} path */
export const get = (path) => request("GET", path);
// "sent" at each command of this page to the vehicle.
export const commands = new EventTarget();

/** @param {string} name */
export function command(name, body = {}) {
  commands.dispatchEvent(new Event("sent"));
  return request("POST", `/api/commands/${name}`, body);
}
