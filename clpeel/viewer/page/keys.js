// Keys: they work as soon as the page is there, wherever the focus is, except where a key is typed into something.

import { keyEvent } from './events.js'

const REPEATED = new Set(['a', 'd', '+', '=', '-', '[', ']']) // what goes on while it is held
const TYPED_INTO = 'input:not([type=checkbox], [type=range], [type=color]), select, textarea'
const OF_CONTROLS = /^( |Enter|Tab|Escape|Arrow.*|Home|End|Page.*)$/ // keys that move and press buttons and sliders

/** Return the keys in a text of the help such as "A D" or "Space", in lower case; none if it tells something else. */
export function keysIn (text) {
  if (text === 'Space') return [' ']
  return /^\S( \S)*$/.test(text) ? text.toLowerCase().split(' ') : []
}

/** own: what the page does itself, by key. send takes all other keys. */
export function listen (own, send) {
  window.addEventListener('keydown', (event) => {
    if (event.isComposing || !event.key) return
    const key = event.key.toLowerCase()
    const does = hasModifier(event) ? undefined : own[key]
    if (!isForScene(event, key)) return
    event.stopPropagation() // renderview hears keys only after a click, and no repeated ones
    if (event.key.length === 1 && !hasModifier(event)) event.preventDefault() // such as Firefox's search
    if (event.repeat && !REPEATED.has(key)) return
    if (does !== undefined) does()
    if (does === undefined || does.isSent) send(keyEvent(event))
  }, { capture: true })
}

function hasModifier (event) {
  return (event.ctrlKey || event.altKey || event.metaKey) && !event.getModifierState('AltGraph')
}

function isForScene (event, key) {
  const dialog = document.querySelector('dialog[open]')
  if (dialog !== null) return dialog.dataset.key !== undefined && dialog.dataset.key.includes(key)
  const target = event.target instanceof Element ? event.target : document.body
  if (target.closest('#rendercanvas-focus-element-container')) return true
  if (target.matches(TYPED_INTO)) return false
  return !(target.closest('input, button, a') && OF_CONTROLS.test(event.key))
}
