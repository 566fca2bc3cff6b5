// SPDX-License-Identifier: Apache-2.0
// The service worker of the page without a server: keeps the files that the page asks for, so that it opens without a network.
// The network comes first, so that a new version is seen.

interface Extended extends Event {
  waitUntil(work: Promise<unknown>): void;
}
interface Fetching extends Event {
  readonly request: Request;
  respondWith(response: Promise<Response>): void;
}
const scope = self as unknown as {
  skipWaiting(): Promise<void>;
  readonly clients: { claim(): Promise<void> };
  addEventListener<E extends Event>(type: string, listener: (event: E) => void): void;
};

async function answer(request: Request): Promise<Response> {
  const cache = await caches.open("pointfair");
  try {
    const response = await fetch(request);
    if (response.ok) await cache.put(request, response.clone());
    return response;
  } catch (error) {
    const kept = await cache.match(request, { ignoreSearch: true });
    if (kept) return kept;
    throw error;
  }
}

scope.addEventListener<Extended>("install", (event) => event.waitUntil(scope.skipWaiting()));
scope.addEventListener<Extended>("activate", (event) => event.waitUntil(scope.clients.claim()));
scope.addEventListener<Fetching>("fetch", (event) => {
  if (event.request.method === "GET") event.respondWith(answer(event.request));
});
