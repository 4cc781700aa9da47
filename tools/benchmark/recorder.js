// What the figure `live` records in a page. It runs before the page's own scripts, and touches only what every page has:
// pointer events, the web socket, and images that are made of what it brings. Times are those of performance.now(), ms.
(() => {
  const events = []
  // One for each move of the mouse while a button is down. since: when the browser got it. at: when the page did.
  const messages = []
  // One for each message that took moves to the server; the last one says that the button is up. clock: of the message; they grow.
  const frames = []
  // One for each picture. decoded: when it was. answers: the clock of the newest message that it was drawn after.
  window.recorder = { events, messages, frames }

  addEventListener('pointermove', (event) => {
    if (!event.buttons) return
    const at = performance.now()
    const parts = event.getCoalescedEvents()
    for (const part of parts.length ? parts : [event]) events.push({ since: part.timeStamp, at })
  }, true)

  window.WebSocket = class extends WebSocket {
    constructor (...parameters) {
      super(...parameters)
      this.addEventListener('message', ({ data }) => clpeelGets(data))
    }

    send (data) {
      const at = performance.now()
      super.send(data)
      if (typeof data === 'string') clpeelSends(JSON.parse(data), at)
      else trameSends(data, at)
    }
  }

  // --- pictures: clpeel's page decodes what came into a bitmap, trame's shows it as an image ---

  const { createImageBitmap } = window
  window.createImageBitmap = async (blob, ...more) => {
    const frame = clpeelShows(blob)
    const bitmap = await createImageBitmap.call(window, blob, ...more)
    if (frame) frames.push({ decoded: performance.now(), ...frame })
    return bitmap
  }

  const { createObjectURL } = URL
  const pictures = new Map()
  URL.createObjectURL = (blob) => {
    const url = createObjectURL.call(URL, blob)
    if (blob.type.startsWith('image/')) pictures.set(url, blob)
    return url
  }

  const source = Object.getOwnPropertyDescriptor(HTMLImageElement.prototype, 'src')
  Object.defineProperty(HTMLImageElement.prototype, 'src', {
    ...source,
    set (url) {
      const blob = pictures.get(url)
      pictures.delete(url)
      if (blob) this.addEventListener('load', () => loaded(this, blob), { once: true })
      source.set.call(this, url)
    }
  })

  async function loaded (image, blob) {
    let decoded = performance.now()
    try {
      await image.decode()
      decoded = performance.now()
    } catch {} // it shows the next picture by now
    const frame = await trameShows(blob)
    if (frame) frames.push({ decoded, ...frame })
  }

  // --- clpeel: texts, and a picture after the text that announces it ---

  let arrived = [] // pictures that came, the newest first
  let announced = null

  function clpeelGets (data) {
    if (typeof data === 'string') {
      const message = JSON.parse(data)
      if (message.type === 'framebufferdata') announced = message.status
    } else if (announced !== null) {
      const { answers, milliseconds, scale, width, height, lossless, coarse } = announced
      const bytes = data.size ?? data.byteLength
      arrived = [{ answers, milliseconds, scale, width, height, bytes, coarse, settled: lossless }, ...arrived].slice(0, 8)
      announced = null
    }
  }

  function clpeelShows (blob) {
    return arrived.find((frame) => frame.bytes === blob.size)
  }

  function clpeelSends (message, at) {
    if (message.type === 'pointer_move' || message.type === 'pointer_up') messages.push({ at, clock: message.timestamp })
  }

  // --- trame: packed bytes. Mouse messages are counted; live_pyvista.py writes the count behind a picture's bytes ---

  const MARK = 128
  let count = 0

  function trameSends (data, at) {
    if (!new TextDecoder('latin1').decode(data).includes('viewport.mouse.interaction')) return
    count += 1
    messages.push({ at, clock: count })
  }

  async function trameShows (blob) {
    const mark = await blob.slice(-MARK).text()
    return mark.startsWith('{') ? { bytes: blob.size - MARK, coarse: false, ...JSON.parse(mark) } : null
  }
})()
