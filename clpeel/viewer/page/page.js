// The page of the live view: joins the socket, the picture, what the hand does, and what is told around the picture.

import { Connection } from './connection.js'
import { element, find } from './elements.js'
import { keyEvent, timestamp } from './events.js'
import { Figures } from './figures.js'
import { keysIn, listen } from './keys.js'
import { fillHelp, notify, showCommand, showConnection, toggleHelp } from './messages.js'
import { Panel } from './panel.js'
import { Picture } from './picture.js'
import { listenToTouch } from './touch.js'
import { View } from './view.js'

const TELL = 100 // milliseconds between two changes of the figures while something moves
const WIDE = window.matchMedia('(min-width: 900px)') // where there is room for the panel beside the picture
const PATIENCE = 500 // milliseconds after which the page says that it has not saved yet

const { dataset } = document.body
const description = await fetchDescription()
document.title = description.title
const answeredKeys = new Set(description.keys.flatMap(([text]) => keysIn(text))) // the server answers with a frame
answeredKeys.delete('c') // it is told in the terminal

let steering = null // whether the events of this page count; null while nobody has said
let notice = ''
let saving = false
let told = 0 // when the figures were shown last
let place = '' // of the latest pointer event

const figures = new Figures(description)
const panel = new Panel(description, (name, value) => send({ type: 'set', name, value }))
const picture = new Picture(find('#view'), showFrame, showWaiting)
const view = new View(find('#view'), send)
const connection = new Connection({ message: take, frame: (frame) => picture.take(frame), state: showState })

// What the page does itself. The server prints the command too.
const togglePanel = () => panel.toggle()
const own = { h: toggleHelp, '?': toggleHelp, p: togglePanel, s: save, c: Object.assign(command, { isSent: true }) }
const buttons = { help: toggleHelp, panel: togglePanel, save, command: sendCommand, reset: () => press('r') }

/** For tests, and for whoever opens the console. */
window.clpeel = { get status () { return picture.frame?.status }, lossless: () => picture.lossless() }

listen(own, send)
listenToTouch(find('#stage'), send)
fillHelp(description.keys)
document.addEventListener('click', onClick, { capture: true })
WIDE.addEventListener('change', () => panel.toggle(WIDE.matches))
panel.toggle(WIDE.matches)
document.addEventListener('visibilitychange', sendVisibility)

async function fetchDescription () {
  try {
    return await (await fetch('viewer.json')).json()
  } catch (error) {
    showConnection('clpeel does not answer. Has it ended?', () => location.reload())
    throw error
  }
}

function onClick (event) {
  const button = event.target.closest?.('button')
  if (event.detail > 0) button?.blur() // a button that keeps the focus after a click would take the next Space
  buttons[button?.dataset.does]?.()
}

// --- to the server ---

/** Tell the server of a key that a button stands for. */
function press (key) {
  send(keyEvent({ key, getModifierState: () => false }))
}

function send (message) {
  if (!steering || !connection.isOpen) return
  const time = timestamp()
  if (isAnswered(message)) picture.ask(time)
  connection.send({ ...message, timestamp: time })
}

/** Return whether the server sends a frame because of this message, at least the same with another status. */
function isAnswered ({ type, key, modifiers, x, y, button }) {
  if (type === 'key_down') return answeredKeys.has(key.toLowerCase()) && !/Control|Alt|Meta/.test(modifiers)
  if (!type.startsWith('pointer_')) return ['set', 'wheel', 'double_click'].includes(type)
  const moved = place !== `${x} ${y}`
  place = `${x} ${y}`
  return type === 'pointer_move' && moved && button >= 1 && button <= 3
}

function sendVisibility () {
  connection.send({ type: document.hidden ? 'hide' : 'show', timestamp: timestamp() })
}

// --- from the server ---

function take (message) {
  if (message.type !== 'active' || message.value === steering) return
  steering = message.value
  dataset.steering = steering
  panel.enable(steering)
  if (steering) view.sendSize()
  if (picture.frame !== null) figures.show(picture.frame.status, steering)
}

function showState (state, text) {
  dataset.connection = state
  showConnection(text, () => connection.restart())
  if (state === 'open') {
    if (document.hidden) sendVisibility()
  } else {
    steering = null
    picture.forget()
    panel.enable(false)
  }
}

function showFrame ({ index, status }, answers) {
  Object.assign(dataset, { frame: index, lossless: status.lossless, full: status.full, technique: status.technique })
  if (status.full || performance.now() - told >= TELL) { // nobody reads faster, and each frame would lay out the page
    told = performance.now()
    figures.show(status, steering !== false)
    panel.show(status)
  }
  if (status.notice !== notice || (answers && status.notice !== '')) notify(status.notice)
  notice = status.notice
}

function showWaiting (waiting) {
  dataset.waiting = waiting
  figures.showDrawing(waiting)
}

// --- what the page does itself ---

async function command () {
  const status = await picture.status()
  await showCommand(status.command)
}

function sendCommand () {
  press('c')
  command()
}

async function save () {
  if (saving) return
  saving = true
  const timer = setTimeout(() => notify('The picture is saved as soon as it is complete.'), PATIENCE)
  const url = URL.createObjectURL(await picture.lossless())
  clearTimeout(timer)
  saving = false
  element('a', { href: url, download: 'clpeel.png' }).click()
  setTimeout(() => URL.revokeObjectURL(url), 60000)
  notify('Saved as clpeel.png.')
}
