// A worker's timer: a page in the background has its own throttled to once a second.
setInterval(() => postMessage(0), 20);
