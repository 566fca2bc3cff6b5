// SPDX-License-Identifier: Apache-2.0
// How the page reaches its session: a server over a WebSocket (server.ts), or a worker of this browser (local_session.ts).

/** What a transport tells. */
export interface Listener {
  opened(): void;
  /** A message, as viewer/message.hpp writes it. */
  arrived(frame: ArrayBuffer): void;
  /** An error that the session did not send itself. */
  failed(words: string): void;
  /** True: it is to connect again. */
  closed(): boolean;
}

export interface Transport {
  readonly isOpen: boolean;
  send(text: string): void;
  /** Ends the run under way, which the session confirms. `text`: the message that asks for it. */
  cancel(text: string): void;
  /** Gives a file to the session. Throws with what is wrong, in words. */
  open(file: File): Promise<void>;
}
