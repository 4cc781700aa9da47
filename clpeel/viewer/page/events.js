// Events as renderview makes them, for what renderview has no events of. They get their time when they are sent.

const MODIFIERS = { Alt: 'altKey', Control: 'ctrlKey', Meta: 'metaKey', Shift: 'shiftKey' }

let latest = 0

/** Return the time, in seconds since 1970. No two are the same. */
export function timestamp () {
  latest = Math.max((performance.timeOrigin + performance.now()) / 1000, latest + 1e-6)
  return latest
}

/** Return the modifiers of an event. Those that only make a character, as AltGr does, are none. */
export function modifiersOf (event) {
  const character = event.getModifierState('AltGraph')
  return Object.keys(MODIFIERS).filter((name) => event[MODIFIERS[name]] && !(character && /Alt|Control/.test(name)))
}

export function pointerEvent (type, [x, y], button, buttons) {
  return { type, x, y, button, buttons, modifiers: [], ntouches: 0, touches: {} }
}

export function wheelEvent ([x, y], dy, modifiers = []) {
  return { type: 'wheel', x, y, dx: 0, dy, buttons: [], modifiers }
}

export function keyEvent (event) {
  return { type: 'key_down', key: event.key, modifiers: modifiersOf(event) }
}
