// Requests to our own API. An error's message is the one line the server gave.

import { here } from "./vehicle_path.js";

/** @param {string} method @param {string} path @param {unknown} [body] @returns {Promise<any>} */
export async function request(method, path, body) {
  let response;
  try {
    response = await fetch(here(path), {
      method,
      headers: body === undefined ? {} : { "Content-Type": "application/json" },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
  } catch {
    throw new Error("this page's server does not answer; is it running?");
  }
  const content = await response.json().catch(() => ({}));
  if (!response.ok) {
    throw Object.assign(new Error(content.error ?? `error ${response.status}`), { status: response.status });
  }
  return content;
}

// An answer of numbers.
/** @param {string} path @returns {Promise<ArrayBuffer>} */
export async function binary(path) {
  const response = await fetch(here(path));
  if (response.ok) return response.arrayBuffer();
  const content = await response.json().catch(() => ({}));
  throw new Error(content.error ?? `error ${response.status}`);
}

/** @param {string} path */
export const get = (path) => request("GET", path);
/** @param {string} name */
export const command = (name, body = {}) => request("POST", `/api/commands/${name}`, body);
