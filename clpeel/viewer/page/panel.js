// The panel: a native control for each setting, made from what the server says about them.

import { element, find } from './elements.js'
import { HEAT } from './figures.js'

const GROUPS = [
  ['picture', ['technique', 'shows', 'opacity', 'lighting', 'background', 'orthographic', 'turning', 'samples']],
  ['peeling', ['passes', 'occlusion_query', 'layers_per_pass', 'coincident']],
  ['precision', ['precision', 'depth_format', 'max_error']],
  ['drawing', ['opaque', 'execution']]
]
const NUMBERS = {
  passes: { min: 1, step: 1, placeholder: 'no limit', inputMode: 'numeric' },
  layers_per_pass: { min: 1, step: 1, placeholder: '8', inputMode: 'numeric' },
  max_error: { min: 0, max: 1, step: 'any', placeholder: 'none', inputMode: 'decimal' }
}
const HOLD = 300 // milliseconds in which frames that were on their way may still tell the value before
const REFUSED = 10000 // milliseconds after which the value before must be the one that is meant

export class Panel {
  /** set takes the name and the value of a setting that the user changes. */
  constructor (description, set) {
    const { labels, choices, options, common } = description
    this.options = options
    this.common = common
    this.root = find('#panel')
    const names = Object.keys(labels)
    this.controls = names.map((name) => makeControl(name, labels[name], choices[name], set))
    const rest = names.filter((name) => !GROUPS.some(([, grouped]) => grouped.includes(name)))
    this.groups = [...GROUPS, ['more', rest]].map(([title, grouped]) => {
      const rows = this.controls.filter(({ name }) => grouped.includes(name)).map(({ row }) => row)
      return element('fieldset', { hidden: rows.length === 0 }, element('legend', { textContent: title }), ...rows)
    })
    const form = find('form', this.root)
    form.append(...this.groups)
    form.addEventListener('submit', (event) => event.preventDefault())
    this.technique = ''
    blurAfterClicks(this.root)
  }

  /** Follow the settings of a status. */
  show ({ settings, notice }) {
    for (const control of this.controls) {
      if (settings.technique !== this.technique) this.disable(control, settings.technique)
      control.follow(settings[control.name], notice !== '')
    }
    this.technique = settings.technique
  }

  /** Disable a setting that the technique lacks, and say which ones have it. */
  disable (control, technique) {
    const having = Object.keys(this.options).filter((each) => this.options[each].includes(control.name))
    const lacking = having.length > 0 && !this.common.includes(control.name) && !having.includes(technique)
    control.disable(lacking)
    control.row.title = lacking ? `${technique} has no such setting. These have it: ${having.join(', ')}.` : ''
  }

  /** Let the user change settings, or not. */
  enable (enabled) {
    for (const group of this.groups) group.disabled = !enabled
    find('[data-does=reset]', this.root).disabled = !enabled
  }

  get isOpen () {
    return !this.root.hidden
  }

  toggle (open = !this.isOpen) {
    const button = find('#tools [data-does=panel]')
    if (!open && this.root.contains(document.activeElement)) button.focus()
    this.root.hidden = !open
    button.ariaExpanded = String(open)
    document.body.dataset.panel = open ? 'open' : 'closed'
  }
}

/** Let a list or a switch that was clicked lose the focus, else it would take the next key for a choice. */
function blurAfterClicks (root) {
  let clicked = false
  root.addEventListener('pointerdown', () => { clicked = true }, { capture: true })
  root.addEventListener('keydown', (event) => {
    clicked = false
    if (event.key === 'Escape' && event.target.matches('input, select')) event.target.blur()
  }, { capture: true })
  root.addEventListener('change', (event) => { if (clicked && event.target.type !== 'number') event.target.blur() })
}

function makeControl (name, label, choices, set) {
  const Kind = { opacity: Opacity, background: Background }[name] ??
    (choices !== undefined ? Choice : name in NUMBERS ? Quantity : Flag)
  return new Kind(name, label, choices, set)
}

/** A control keeps what the user chooses until the server has had time to follow, or refuses. */
class Control {
  constructor (name, label, input, set) {
    this.name = name
    this.input = Object.assign(input, { id: `set-${name}`, name })
    this.set = set
    this.value = undefined // the latest that the server told
    this.before = undefined // what it told before the user's choice
    this.changed = -Infinity // when that was
    this.editing = false
    this.refused = false
    this.row = element('div', { className: 'row' }, element('label', { htmlFor: input.id, textContent: label }), input)
    input.addEventListener('input', () => { this.editing = true })
    input.addEventListener('change', () => { this.editing = false })
    input.addEventListener('blur', () => {
      this.editing = false
      this.apply()
    })
  }

  choose (value) {
    if (performance.now() > this.changed + HOLD) this.before = JSON.stringify(this.value)
    this.changed = performance.now()
    this.refused = false
    this.set(this.name, value)
    setTimeout(() => this.apply(), HOLD + 1)
  }

  follow (value, refused) {
    this.value = value
    this.refused = refused
    this.apply()
  }

  apply () {
    if (this.value === undefined || this.editing) return
    const since = performance.now() - this.changed
    if (since < HOLD) return
    if (since < REFUSED && !this.refused && JSON.stringify(this.value) === this.before) return
    this.before = undefined
    this.show(this.value)
  }

  disable (disabled) {
    this.row.classList.toggle('lacking', disabled)
    for (const each of this.row.querySelectorAll('input, select, button')) each.disabled = disabled
  }
}

class Choice extends Control {
  constructor (name, label, choices, set) {
    const options = choices.map((value) =>
      element('option', { value: JSON.stringify(value), textContent: HEAT[value] ?? value }))
    super(name, label, element('select', {}, ...options), set)
    this.input.addEventListener('change', () => this.choose(JSON.parse(this.input.value)))
  }

  show (value) {
    this.input.value = JSON.stringify(value)
  }
}

class Flag extends Control {
  constructor (name, label, choices, set) {
    super(name, label, element('input', { type: 'checkbox' }), set)
    this.input.addEventListener('change', () => this.choose(this.input.checked))
  }

  show (value) {
    this.input.checked = value
  }
}

class Quantity extends Control {
  constructor (name, label, choices, set) {
    super(name, label, element('input', { type: 'number', ...NUMBERS[name] }), set)
    this.input.addEventListener('change', () => {
      if (!this.input.checkValidity()) this.input.reportValidity()
      else this.choose(this.input.value === '' ? null : Number(this.input.value))
    })
  }

  show (value) {
    this.input.value = value ?? ''
  }
}

class Opacity extends Control {
  constructor (name, label, choices, set) {
    super(name, label, element('input', { type: 'range', min: 0, max: 1, step: 0.01, value: 1 }), set)
    this.text = element('output', { htmlFor: this.input.id })
    this.own = element('button', { type: 'button', textContent: 'file’s own', title: 'the opacity of the file' })
    this.row.append(this.text, this.own)
    this.row.classList.add('slider')
    this.input.addEventListener('input', () => this.choose(this.tell(Number(this.input.value))))
    this.own.addEventListener('click', () => this.choose(this.tell(null)))
  }

  tell (value) {
    this.text.textContent = value === null ? '' : value.toFixed(2)
    this.own.ariaPressed = String(value === null)
    this.row.classList.toggle('unset', value === null)
    this.input.ariaValueText = value === null ? 'the file’s own' : value.toFixed(2)
    return value
  }

  show (value) {
    if (value !== null) this.input.value = value
    this.tell(value)
  }
}

function asHex (color) {
  const [red, green, blue] = color.map((part) => Math.round(part * 255))
  return '#' + (red * 65536 + green * 256 + blue).toString(16).padStart(6, '0')
}

class Background extends Control {
  constructor (name, label, choices, set) {
    super(name, label, element('input', { type: 'color' }), set)
    this.none = element('button', { type: 'button', textContent: 'none', title: 'a transparent background' })
    this.row.append(this.none)
    this.row.classList.add('color')
    this.input.addEventListener('input', () => {
      this.none.ariaPressed = 'false'
      this.input.title = ''
      this.choose(this.input.value.match(/[0-9a-f]{2}/gi).map((pair) => parseInt(pair, 16) / 255))
    })
    this.none.addEventListener('click', () => {
      this.none.ariaPressed = 'true'
      this.choose(null)
    })
  }

  show (value) {
    this.none.ariaPressed = String(value === null)
    const shades = Array.isArray(value?.[0]) ? value.map(asHex) : [asHex(value ?? [0.5, 0.5, 0.5])]
    this.input.value = shades[0] // of a gradient, the colour at the top
    this.input.title = shades.length > 1 ? `a gradient, ${shades[0]} at the top, ${shades[1]} at the bottom` : ''
  }
}
