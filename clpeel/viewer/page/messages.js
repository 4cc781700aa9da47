// What the page tells in words: the help, the command line, notices, and the state of the connection.

import { element, find } from './elements.js'
import { keysIn } from './keys.js'

const LONG_ENOUGH = 6000 // milliseconds to read a notice in
const TOUCH = [
  ['one finger', 'rotate'],
  ['two fingers', 'pan, and zoom by pinching'],
  ['double tap', 'look at what is there']
]

export function fillHelp (keys) {
  const touch = window.matchMedia('(any-pointer: coarse)').matches ? TOUCH : []
  find('#help dl').replaceChildren(...[...touch, ...keys].map(([key, what]) =>
    element('div', {}, element('dt', {}, ...caps(key)), element('dd', { textContent: what }))))
}

/** Return a text such as "Ctrl + drag, right drag" as it is, and one such as "A D" as keys. */
function caps (text) {
  return keysIn(text).length ? text.split(' ').map((key) => element('kbd', { textContent: key })) : [text]
}

export function toggleHelp () {
  const help = find('#help')
  help.open ? help.close() : help.showModal()
}

/** Show the command line, and copy it if the browser lets us. */
export async function showCommand (text) {
  const dialog = find('#command')
  const told = find('output', dialog)
  told.textContent = ''
  const words = text.split(' ').map((word) => element('span', { textContent: word }))
  find('pre', dialog).replaceChildren(...words.flatMap((word) => [' ', word]).slice(1))
  if (!dialog.open) dialog.showModal()
  find('p button', dialog).onclick = async () => { told.textContent = await copied(text) ? 'Copied.' : 'Press Ctrl-C.' }
  if (await copied(text)) told.textContent = 'Copied.'
}

/** Copy a text. Return whether that worked; if it did not, the text is selected. */
async function copied (text) {
  try {
    await navigator.clipboard.writeText(text)
    return true
  } catch { // not allowed, or not over plain HTTP
    window.getSelection().selectAllChildren(find('#command pre'))
    return document.execCommand('copy')
  }
}

let timer = null

export function notify (text) {
  const notice = find('#notice')
  clearTimeout(timer)
  notice.textContent = text
  notice.hidden = text === ''
  timer = setTimeout(() => { notice.hidden = true }, LONG_ENOUGH)
}

export function showConnection (text, restart) {
  const root = find('#connection')
  root.hidden = text === ''
  find('span', root).textContent = text
  find('button', root).onclick = restart
}
