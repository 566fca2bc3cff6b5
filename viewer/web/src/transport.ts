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

/** A scan, and the files that it names: libraries of materials and pictures. */
export interface Given {
  file: File;
  named: File[];
  aside: File[]; // neither of both
}

const kNamed = /\.(mtl|png|jpe?g|webp)$/i;

/** Which of the files is the scan: the first that no scan names. */
export function given(files: File[]): Given {
  const file = files.find(({ name }) => !kNamed.test(name)) ?? files[0];
  const others = files.filter((other) => other !== file);
  const isNamed = ({ name }: File) => kNamed.test(name);
  return { file, named: others.filter(isNamed), aside: others.filter((other) => !isNamed(other)) };
}

export interface Transport {
  readonly isOpen: boolean;
  send(text: string): void;
  /** Ends the run under way, which the session confirms. `text`: the message that asks for it. */
  cancel(text: string): void;
  /** Gives a scan to the session, after what it names. Throws with what is wrong, in words. */
  open(scan: Given): Promise<void>;
}
