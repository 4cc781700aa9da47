// What the hand does on the picture: renderview's events of the mouse, and our own of the wheel and of the size.

import './renderview.js'
import { modifiersOf, wheelEvent } from './events.js'

const SENT = new Set(['resize', 'pointer_down', 'pointer_move', 'pointer_up', 'double_click'])
const MOST_PIXELS = 1 << 25 // of a picture, and on its side (guard.py)
const MOST_SIDE = 1 << 14
const PIXELS = [1, 16, 600] // of a wheel that counts pixels, lines or pages
const PINCH = 7 // makes pinching on a touchpad, which browsers tell as small turns of a wheel with Ctrl, as fast

export class View extends window.BaseRenderView {
  constructor (image, send) {
    image.style.width = image.style.height = '100%' // else renderview bounds them
    super(image, null)
    this.send = send
    this.size = null // the latest resize
    this.dragging = false
    this.setThrottle(0) // browsers tell of one move for each picture of the screen
    this._focusElement.ariaLabel = 'Keys for the scene'
    this.observeRatio(image)
    this.observeWheel(image.parentElement)
  }

  /** Also hear of sizes that change in device pixels alone, as when a window goes to another screen. */
  observeRatio (image) {
    const query = window.matchMedia(`(resolution: ${window.devicePixelRatio}dppx)`)
    query.addEventListener('change', () => {
      this._resizeObserver.unobserve(image)
      this._resizeObserver.observe(image)
      this.observeRatio(image)
    }, { once: true })
  }

  /** Take the wheel without a click before, and send it once for each picture of the screen. */
  observeWheel (stage) {
    let turned = null
    stage.addEventListener('wheel', (event) => {
      event.preventDefault()
      event.stopPropagation()
      const pinched = event.ctrlKey && event.deltaMode === 0 && Math.abs(event.deltaY) < 50
      const dy = event.deltaY * PIXELS[event.deltaMode] * (pinched ? PINCH : 1)
      if (turned === null) {
        requestAnimationFrame(() => {
          this.send(turned)
          turned = null
        })
      }
      turned = wheelEvent([event.clientX, event.clientY], dy + (turned?.dy ?? 0), modifiersOf(event))
    }, { capture: true, passive: false })
  }

  onEvent (event) {
    if (!SENT.has(event.type)) return
    if (event.type === 'resize') event = this.size = corrected(event, this.viewElement)
    // Moves tell something while a button is down. renderview may hold one back until after the button is up, which
    // has told the place by then. One without a button tells that the button was let go where nobody saw it.
    if (event.type === 'pointer_move' && !this.dragging) return
    if (event.type.startsWith('pointer')) this.dragging = event.type !== 'pointer_up' && event.buttons.length > 0
    this.send(event)
  }

  /** Send the size once more. */
  sendSize () {
    if (this.size !== null) this.send(this.size)
  }
}

/** Return a resize in true device pixels, but no more of them than the server accepts. */
function corrected (event, element) {
  const { width, height } = element.getBoundingClientRect()
  let sides = [event.pwidth, event.pheight]
  if (Math.abs(sides[0] - width * event.ratio) > 2) { // Chromium tells logical pixels where a device is emulated
    sides = [width * event.ratio, height * event.ratio]
  }
  const scale = Math.min(1, Math.sqrt(MOST_PIXELS / (sides[0] * sides[1])), MOST_SIDE / Math.max(...sides))
  const [pwidth, pheight] = sides.map((side) => Math.max(Math.floor(side * scale), 1))
  return { ...event, width, height, pwidth, pheight }
}
