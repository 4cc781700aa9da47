// The picture: shows the newest frame, and confirms each frame that it has shown.

const PATIENCE = 300 // milliseconds without an answer after which the page says that something is drawn

export class Picture {
  /**
   * onShown takes each frame that is shown, and whether an input was waiting for it. onWaiting takes whether the user
   * has waited for a while.
   */
  constructor (canvas, onShown, onWaiting) {
    this.screen = canvas.getContext('bitmaprenderer')
    this.onShown = onShown
    this.onWaiting = onWaiting
    this.frame = null // the one that is shown: {index, status, blob, confirm}
    this.next = null
    this.busy = false
    this.asked = 0 // when the latest input was sent
    this.timer = null
  }

  /** Take a frame in place of those that are not shown yet. */
  take (frame) {
    this.next = frame
    if (!this.busy) this.showAll()
  }

  async showAll () {
    this.busy = true
    while (this.next !== null) {
      const frame = this.next
      this.next = null
      await this.show(frame)
    }
    this.busy = false
  }

  async show (frame) {
    try {
      this.screen.transferFromImageBitmap(await createImageBitmap(frame.blob)) // an <img> decodes for the next frame alone
    } catch (error) {
      console.error(`frame ${frame.index}: ${error}`)
    }
    frame.confirm() // at once, so that the next one is drawn while the screen takes this one
    const waited = !this.isAnswered
    this.frame = frame
    this.watch()
    this.onShown(frame, waited && this.isAnswered)
  }

  /** Take note that an input was sent at this time, which a frame must answer. */
  ask (time) {
    const begins = this.isAnswered
    this.asked = time
    if (begins) this.watch()
  }

  /** Forget what is awaited. */
  forget () {
    this.asked = 0
    clearTimeout(this.timer)
    this.onWaiting(false)
  }

  /** Whether the frame that is shown is of the view after the latest input. */
  get isAnswered () {
    return this.asked === 0 || (this.frame !== null && this.frame.status.seen >= this.asked)
  }

  /** Say so if neither an answer nor the full picture comes soon. After an error, none may come at all. */
  watch () {
    clearTimeout(this.timer)
    this.onWaiting(false)
    const { full, notice } = this.frame?.status ?? { full: true, notice: '' }
    if (notice === '' && !(this.isAnswered && full)) this.timer = setTimeout(() => this.onWaiting(true), PATIENCE)
  }

  get isLossless () {
    return this.isAnswered && this.frame !== null && this.frame.status.lossless
  }

  /** Return the status of the present view, as soon as there is one, or the latest where there may be none for long. */
  async status () {
    const isDone = ({ status }) => this.isAnswered || status.notice !== '' || status.settings.turning
    while (this.frame === null || !isDone(this.frame)) await pause()
    return this.frame.status
  }

  /** Return the lossless picture of the present view, a PNG, as soon as there is one. */
  async lossless () {
    while (!this.isLossless) await pause()
    return this.frame.blob
  }
}

function pause () {
  return new Promise((resolve) => setTimeout(resolve, 20))
}
