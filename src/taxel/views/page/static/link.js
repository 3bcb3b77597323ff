// The wire: exchange the key for a cookie, hold one WebSocket open, say "seen" to each push.

/** Exchange the key behind the # for a cookie and take it out of the address bar. */
export async function enter() {
  const key = location.hash.slice(1);
  if (key) {
    history.replaceState(null, "", location.pathname);
    const answer = await fetch("/enter", { method: "POST", body: key });
    if (!answer.ok) return "that key is not this page's: open the address that taxel printed";
  }
  const answer = await fetch("/session");
  return answer.ok ? "" : "needed the key: open the address that taxel printed";
}

const GOING_AWAY = 1001, RESTARTING = 1012; // how a server that is asked to end closes, RFC 6455

/** One connection that comes back by itself. */
export class Link {
  /** `on`: {push(message), image(camera, blob), other(message), gone(reason)}. */
  constructor(on) {
    this.on = on;
    this.socket = null;
    this.ended = false; // the server said goodbye, as where the station's time is over
    this.waitMs = 250;
  }

  async open() {
    try {
      const reason = await enter();
      if (reason) {
        this.on.gone(reason);
        this.again(3000);
        return;
      }
    } catch {
      this.on.gone(this.silence());
      this.again();
      return;
    }
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.take(socket, event.data);
    socket.onclose = (event) => {
      this.socket = null;
      this.ended = event.code === GOING_AWAY || event.code === RESTARTING;
      this.on.gone(event.reason || this.silence());
      this.again();
    };
    this.socket = socket;
  }

  silence() {
    return this.ended ? "the station has ended" : "the station does not answer";
  }

  again(waitMs = this.waitMs) {
    setTimeout(() => this.open(), waitMs);
    this.waitMs = Math.min(2000, this.waitMs * 1.5);
  }

  take(socket, data) {
    if (data instanceof ArrayBuffer) {
      const camera = new Uint8Array(data, 0, 1)[0];
      this.on.image(camera, new Blob([new Uint8Array(data, 1)], { type: "image/jpeg" }));
      return;
    }
    const message = JSON.parse(data);
    if ("number" in message) {
      this.waitMs = 250;
      this.ended = false;
      socket.send(JSON.stringify({ do: "seen", number: message.number }));
      this.on.push(message);
    } else {
      this.on.other(message);
    }
  }

  /** Send a command; false where there is no connection. */
  say(command) {
    if (!this.socket || this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(command));
    return true;
  }
}
