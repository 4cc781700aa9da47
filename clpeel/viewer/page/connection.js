// The socket to the server. It comes back by itself after it was lost.

const PAUSES = [0.5, 1, 2, 4, 8, 15] // seconds before it is tried again, each time longer
const WRONG_MESSAGE = 1008 // the code that the server closes a socket with whose page is at fault

export class Connection {
  /**
   * on.message takes a message. on.frame takes a frame: {index, status, blob, confirm}, where confirm tells the server
   * that it is shown. on.state takes 'open', 'lost' or 'refused', and a text about it.
   */
  constructor (on) {
    this.on = on
    this.socket = null
    this.failures = 0
    this.timer = null
    window.addEventListener('online', () => this.retry())
    document.addEventListener('visibilitychange', () => { if (!document.hidden) this.retry() })
    this.connect()
  }

  get isOpen () {
    return this.socket !== null && this.socket.readyState === WebSocket.OPEN
  }

  send (message) {
    if (this.isOpen) this.socket.send(JSON.stringify(message))
  }

  connect () {
    clearTimeout(this.timer)
    this.timer = null
    const socket = new WebSocket(new URL('.', location.href).href.replace(/^http/, 'ws'))
    this.socket = socket
    socket.binaryType = 'blob'
    let header = null // the message of the picture that comes next
    socket.onopen = () => this.on.state('open', '')
    socket.onmessage = ({ data }) => {
      this.failures = 0
      if (typeof data !== 'string') {
        this.take(socket, header, data)
      } else {
        const message = JSON.parse(data)
        if (message.type === 'framebufferdata') header = message
        else this.on.message(message)
      }
    }
    socket.onclose = (event) => this.closed(event)
  }

  take (socket, header, data) {
    const confirm = () => {
      if (socket !== this.socket) return // a new socket counts its frames anew
      const { index, timestamp } = header
      this.send({ type: '_framefeedback', index, timestamp, localtime: Date.now() / 1000 })
    }
    const { index, status, mimetype } = header
    this.on.frame({ index, status, blob: data.slice(0, data.size, mimetype), confirm })
  }

  closed ({ code, reason }) {
    if (code === WRONG_MESSAGE) {
      this.on.state('refused', `Closed by the server: ${reason || 'it did not accept a message'}.`)
      return
    }
    const pause = PAUSES[Math.min(this.failures++, PAUSES.length - 1)]
    const why = reason ? `Closed by the server: ${reason}.` : 'No connection to clpeel. Has it ended?'
    this.on.state('lost', `${why} Next try in ${pause} s.`)
    this.timer = setTimeout(() => this.connect(), pause * 1000)
  }

  /** Try again at once if the socket was lost. */
  retry () {
    if (this.timer !== null) this.connect()
  }

  /** Try again at once, whatever happened before. */
  restart () {
    if (this.socket.readyState === WebSocket.CLOSED) this.connect()
  }
}
