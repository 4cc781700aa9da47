// Touch: one finger rotates, two fingers pan and pinch. It is told to the server as drags and turns of the wheel.

import { pointerEvent, wheelEvent } from './events.js'

const WHEEL = 1.0015 // what a pixel of the wheel multiplies the distance by (motion.py)
const [LEFT, RIGHT] = [1, 2]

/** Hear of fingers on the stage. send takes events of a mouse. */
export function listenToTouch (stage, send) {
  const touch = new Touch(send)
  const hears = (does) => (event) => {
    if (event.pointerType !== 'touch') return
    event.stopPropagation() // renderview takes each finger for a mouse of its own
    does(event.pointerId, [event.clientX, event.clientY])
  }
  const lift = hears((id) => touch.up(id))
  stage.addEventListener('pointerdown', hears((id, at) => touch.down(id, at)), { capture: true })
  stage.addEventListener('pointermove', hears((id, at) => touch.move(id, at)), { capture: true })
  for (const type of ['pointerup', 'pointercancel', 'lostpointercapture']) {
    stage.addEventListener(type, lift, { capture: true })
  }
}

class Touch {
  constructor (send) {
    this.send = send
    this.fingers = new Map() // id -> [x, y], in the order in which they came down
    this.button = 0 // of the drag that is going on
    this.at = [0, 0]
    this.span = 1 // between two fingers
    this.waiting = false
  }

  down (id, at) {
    document.activeElement?.blur()
    this.apply()
    this.fingers.set(id, at)
    if (this.fingers.size === 1) this.begin(LEFT)
    if (this.fingers.size === 2) this.begin(RIGHT)
  }

  move (id, at) {
    if (!this.fingers.has(id)) return
    this.fingers.set(id, at)
    if (!this.waiting) requestAnimationFrame(() => this.apply())
    this.waiting = true
  }

  up (id) {
    if (!this.fingers.has(id)) return
    this.apply()
    if ([...this.fingers.keys()].indexOf(id) < this.button) this.end() // the finger that is left alone rotates nothing
    this.fingers.delete(id)
  }

  begin (button) {
    this.end()
    this.button = button
    ;[this.at, this.span] = this.grip()
    this.send(pointerEvent('pointer_down', this.at, button, [button]))
  }

  end () {
    if (this.button) this.send(pointerEvent('pointer_up', this.at, this.button, []))
    this.button = 0
  }

  /** Send what has moved since the last time. */
  apply () {
    this.waiting = false
    if (!this.button) return
    const [at, span] = this.grip()
    if (at[0] !== this.at[0] || at[1] !== this.at[1]) {
      this.send(pointerEvent('pointer_move', at, this.button, [this.button]))
    }
    if (span !== this.span) this.send(wheelEvent(at, -Math.log(span / this.span) / Math.log(WHEEL)))
    this.at = at
    this.span = span
  }

  /** Return the middle of the fingers that drag, and how far apart they are. */
  grip () {
    const [a, b = a] = [...this.fingers.values()].slice(0, this.button)
    return [[(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], Math.max(Math.hypot(a[0] - b[0], a[1] - b[1]), 1)]
  }
}
