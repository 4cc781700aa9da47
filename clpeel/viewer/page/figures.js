// The figures at the bottom left, as the paper's own program shows them.

import { element, find } from './elements.js'

export const HEAT = { layers: 'heat map of layers', error: 'heat map of errors' }

export class Figures {
  constructor (description) {
    this.root = find('#figures')
    this.options = description.options
  }

  show (status, steering) {
    this.root.hidden = false
    const by = status.auto ? ' (chosen by auto)' : ''
    find('#technique').textContent = status.technique + by
    const rows = rowsOf(status, this.options, steering)
    find('dl', this.root).replaceChildren(...rows.map(([name, value]) =>
      element('div', {}, element('dt', { textContent: name }), element('dd', {}, value))))
  }

  showDrawing (drawing) {
    find('#drawing').hidden = !drawing
  }
}

/** Return what the colours of a heat map stand for. The map has a bar, too, but the panel may cover it. */
function legendOf ({ shows, layers }) {
  const [low, high] = shows === 'layers' ? ['0', whole(Math.max(layers, 1))] : ['¼ of 255', '255 of 255']
  const made = element('span', { className: 'legend' }, low, element('i', { className: 'ramp' }), high)
  made.title = shows === 'layers' ? 'layers of a pixel' : 'the most wrong channel of a pixel, on a logarithmic scale; less is black'
  return made
}

/** Return the figures of a status, as pairs of a text and a text or an element. */
function rowsOf (status, options, steering) {
  const { settings } = status
  const peels = options[status.auto ? 'auto' : status.technique]?.includes('occlusion_query')
  const query = peels ? `, occlusion query ${settings.occlusion_query ? 'on' : 'off'}` : ''
  const rows = [
    ['geometry passes', whole(status.passes) + query],
    ['layers', whole(status.layers)],
    ['fragments', whole(status.fragments)],
    ['time', `${status.milliseconds.toLocaleString('en', { minimumFractionDigits: 1, maximumFractionDigits: 1 })} ms`],
    ['size', `${whole(status.width)} × ${whole(status.height)}${samplesOf(status)}`],
    ['picture', qualityOf(status)]
  ]
  if (status.shows !== 'picture') rows.unshift(['shows', HEAT[status.shows] ?? status.shows], ['colours', legendOf(status)])
  if (settings.opacity !== null) rows.push(['opacity', settings.opacity.toFixed(2)])
  if (status.max_error !== null) {
    rows.push(['error', `max ${share(status.max_error)}, RMS ${share(status.rms_error)} of 1`])
  }
  rows.push(...status.notes.map((note) => ['note', note]))
  if (!steering) rows.push(['watching', 'another page steers'])
  return rows
}

function samplesOf ({ full, samples }) {
  return full && samples > 1 ? `, ${whole(samples)} samples` : ''
}

function qualityOf (status) {
  if (status.full) return status.lossless ? 'lossless' : 'full, not yet lossless'
  const scale = status.scale < 1 ? `, scale ${status.scale.toFixed(2)}` : ''
  return `while moving${scale}${status.coarse ? ', coarser mesh' : ''}`
}

function whole (number) {
  return number.toLocaleString('en')
}

function share (number) {
  return number.toExponential(2)
}
